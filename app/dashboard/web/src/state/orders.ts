/** Orders to vehicles that survey: what was ordered, in words, and sending more. */

import { signal } from "@preact/signals";
import { api } from "../api/client";
import type { LngLat, OrderView, VehicleView } from "../api/types";
import { polygonOf } from "../map/area";
import { wayBetween } from "../map/geo";
import { distance } from "./format";
import { send } from "./session";
import { drawing, mission, picking, selectedId } from "./store";

/** Where the map's menu is open: a place, and where on the page. */
export const mapMenu = signal<{ at: LngLat; x: number; y: number } | null>(null);
/** An area that is to be surveyed denser, until it is said how. */
export const denserRing = signal<readonly LngLat[] | null>(null);
/** The vehicle for which a position is typed. */
export const typingFor = signal<string | null>(null);

/** How long a way through places is. */
export const lengthOf = (way: readonly LngLat[]): number =>
  way.slice(1).reduce((sum, to, i) => sum + wayBetween(way[i] as LngLat, to).metres, 0);

/** What a vehicle was ordered, as one line. */
export function orderWords({ kind, state, way, asked_by }: OrderView): string {
  const what = {
    go: "Goes where it was sent",
    "skip-line": "Leaves out the rest of its line",
    "repeat-line": `Flies a line again, ${distance(lengthOf(way))}`,
    denser: `Surveys a part denser, ${Math.ceil(way.length / 2)} lines, ${distance(lengthOf(way))}`,
  }[kind];
  return `${what}${state === "accepted" ? ", next" : ""}: ordered by ${asked_by}`;
}

interface Led {
  state: string;
  ending: string | null;
}

/** Whether a vehicle can be sent elsewhere now. */
export const takesOrders = (stage: Led, v: Pick<VehicleView, "active" | "withdrawn">): boolean =>
  stage.state === "running" && stage.ending === null && v.active && v.withdrawn === "";

/** Who can be sent to a place, the nearest first, each with how far it is. */
export function nearestTo(at: LngLat, stage: Led, vehicles: readonly VehicleView[]) {
  return vehicles
    .filter((v) => takesOrders(stage, v) && v.lon_deg !== null && v.lat_deg !== null)
    .map((v) => ({
      name: v.name,
      away_m: wayBetween([v.lon_deg as number, v.lat_deg as number], at).metres,
    }))
    .sort((a, b) => a.away_m - b.away_m);
}

/** Lets the next click on the map say where a vehicle goes. */
export function pickPlaceFor(name: string): void {
  picking.value = { what: `where ${name} goes`, onPicked: (at) => void goVehicle(name, at) };
}

/** Lets an area be drawn that is to be surveyed denser. */
export function drawDenser(): void {
  drawing.value = {
    shape: "polygon",
    onDrawn: (ring) => {
      denserRing.value = ring;
    },
  };
}

const ofMission = async <T>(what: string, ask: (id: string) => Promise<T>): Promise<T | null> => {
  const id = selectedId.peek();
  return id && mission.peek() ? send(what, ask(id)) : null;
};

export const goVehicle = (name: string, at: LngLat) =>
  ofMission(`sending ${name} there`, (id) => api.goVehicle(id, name, at));
export const skipLine = (name: string) =>
  ofMission(`leaving out the line of ${name}`, (id) => api.skipLine(id, name));
export const repeatLine = (name: string, near?: LngLat) =>
  ofMission(`the line again by ${name}`, (id) => api.repeatLine(id, name, near ?? null));
export const surveyDenser = (ring: readonly LngLat[], spacing_m: number | null, vehicle: string | null) =>
  ofMission("surveying that denser", (id) => api.denser(id, polygonOf([...ring]), spacing_m, vehicle));
