/** Orders to vehicles in words, and who can be given one. Pure. */

import type { LngLat, OrderView, VehicleView } from "../../api/types";
import { wayBetween } from "../../map/geo";
import { say } from "../../words/say";
import { distance, pointed } from "../format";

/** How long a way through places is. */
export const lengthOf = (way: readonly LngLat[]): number =>
  way.slice(1).reduce((sum, to, i) => sum + wayBetween(way[i] as LngLat, to).metres, 0);

/** What a vehicle was ordered, as one line. */
export function orderWords({ kind, state, way, asked_by }: OrderView): string {
  const what = {
    go: say("orders.goes"),
    "skip-line": say("orders.leavesOut"),
    "repeat-line": say("orders.fliesAgain", { length: distance(lengthOf(way)) }),
    denser: say("orders.surveysDenser", {
      lines: Math.ceil(way.length / 2),
      length: distance(lengthOf(way)),
    }),
  }[kind];
  const next = state === "accepted" ? say("orders.next") : "";
  return say("orders.orderedBy", { what, next, askedBy: asked_by });
}

const LEAST_SPACING_M = 0.5;

/** How far apart lines are to be, as typed: null where nothing was, undefined where that is no such distance. */
export function spacingOf(text: string): number | null | undefined {
  if (text.trim() === "") return null;
  const spacing_m = Number(pointed(text));
  return spacing_m >= LEAST_SPACING_M ? spacing_m : undefined;
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
