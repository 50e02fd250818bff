/** Ships on the map: a triangle that points ahead, and where each will be in six minutes. Pure. */

import type { LngLat, OwnShipView, ShipView } from "../../api/types";
import { fixed } from "../../state/format";
import { say } from "../../words/say";
import { metresPerDegree } from "../geo";
import type { PlaceMark } from "./marks";

const AHEAD_S = 360;
const RAD = Math.PI / 180;

export interface ShipMark {
  at: LngLat;
  /** Where it will be, if it keeps course and speed. */
  ahead: LngLat;
  /** Which way its bow points, degrees from north; null: it does not say. */
  bow_deg: number | null;
  alarm: boolean;
  words: string;
}

/** Ships as they were told `since_s` ago; 0 while they are told of every second. */
export function shipMarks(ships: readonly ShipView[], since_s = 0): ShipMark[] {
  return ships.map((ship) => {
    const at: LngLat = [ship.lon_deg, ship.lat_deg];
    const scale = metresPerDegree(ship.lat_deg);
    const way_m = ship.cog_deg === null ? 0 : (ship.sog_mps ?? 0) * AHEAD_S;
    const course = (ship.cog_deg ?? 0) * RAD;
    return {
      at,
      ahead: [
        at[0] + (way_m * Math.sin(course)) / scale.east,
        at[1] + (way_m * Math.cos(course)) / scale.north,
      ],
      bow_deg: ship.heading_deg ?? ship.cog_deg,
      alarm: ship.closest?.alarm ?? false,
      words: shipWords(ship, since_s),
    };
  });
}

/** The own ship: a boat that points where her bow does, hollow and with its age where she may be elsewhere by now. */
export function ownShipMark(ship: OwnShipView, connected: boolean): PlaceMark {
  const { lat_deg, lon_deg, heading_deg, cog_deg, age_s } = ship;
  const old = !ship.current || !connected;
  return {
    words: old ? say("ships.ownShipOld", { age: minutes(age_s) }) : say("ships.ownShip"),
    sign: "own",
    at: [lon_deg, lat_deg],
    radius_m: 0,
    bow_deg: heading_deg ?? cog_deg ?? 0,
    old,
  };
}

/** A ship that was not heard for so long may be far from where it was. */
const OLD_S = 60;

export function shipWords(ship: ShipView, since_s = 0): string {
  const { name, mmsi, type, sog_mps, own, closest } = ship;
  const who = `${name || `MMSI ${mmsi}`}${own ? say("ships.own") : type ? ` (${type})` : ""}`;
  const speed = sog_mps === null ? "" : `, ${fixed((sog_mps * 3600) / 1852, 1)} kn`;
  const age_s = ship.age_s + since_s;
  const old = age_s < OLD_S ? "" : say("marks.lastHeardAgo", { ageS: minutes(age_s) });
  if (!closest) return who + speed + old;
  const away = say("ships.mFrom", { distanceM: fixed(closest.distance_m, 0), vehicle: closest.vehicle });
  const in_s = closest.in_s - since_s;
  const when = in_s < 1 ? say("ships.now") : say("state.in", { inS: minutes(in_s) });
  return say("ships.cpa", { who, speed, away, when }) + old;
}

export function minutes(seconds: number): string {
  const whole = Math.round(seconds);
  return whole < 60 ? `${whole} s` : `${Math.floor(whole / 60)} min ${whole % 60} s`;
}
