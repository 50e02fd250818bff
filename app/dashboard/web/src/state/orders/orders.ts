/** Orders to vehicles that survey: asked for on cards and map, and sent. */

import { signal } from "@preact/signals";
import { api } from "../../api/client";
import type { LngLat } from "../../api/types";
import { polygonOf } from "../../map/area";
import { say } from "../../words/say";
import { send } from "../session";
import { drawing, mission, picking, selectedId } from "../store";

/** Where the map's menu is open: a place, and where on the page. */
export const mapMenu = signal<{ at: LngLat; x: number; y: number } | null>(null);
/** An area that is to be surveyed denser, until it is said how. */
export const denserRing = signal<readonly LngLat[] | null>(null);
/** The vehicle for which a position is typed. */
export const typingFor = signal<string | null>(null);

/** Lets the next click on the map say where a vehicle goes. */
export function pickPlaceFor(name: string): void {
  picking.value = { what: say("orders.whereItGoes", { name }), onPicked: (at) => void goVehicle(name, at) };
}

/** Lets an area be drawn that is to be surveyed denser. */
export function drawDenser(): void {
  drawing.value = {
    what: "denser",
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
  ofMission(say("orders.sending", { name }), (id) => api.goVehicle(id, name, at));
export const skipLine = (name: string) =>
  ofMission(say("orders.leavingOut", { name }), (id) => api.skipLine(id, name));
export const repeatLine = (name: string, near?: LngLat) =>
  ofMission(say("orders.lineAgainBy", { name }), (id) => api.repeatLine(id, name, near ?? null));
export const surveyDenser = (ring: readonly LngLat[], spacing_m: number | null, vehicle: string | null) =>
  ofMission(say("orders.surveyingDenser"), (id) => api.denser(id, polygonOf([...ring]), spacing_m, vehicle));
