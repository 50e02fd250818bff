/** What swath sonars see now and have missed, as the map draws it. Pure. */

import type { Holidays, LngLat } from "../../api/types";
import { type Bounds, boundsOf, metresPerDegree } from "../geo";

/** The bottom that a vehicle's last ping met, across its heading; the older, the fainter. */
export interface SwathLine {
  ends: readonly [LngLat, LngLat];
  colour: string;
  opacity: number;
}

const FRESH_S = 2;
const GONE_S = 10;

/** How strongly a swath is drawn that was heard of so long ago. */
export function swathOpacity(age_s: number): number {
  return Math.max(0, Math.min(1, (GONE_S - age_s) / (GONE_S - FRESH_S)));
}

/** Where a swath begins to port and ends to starboard. */
export function swathEnds(
  [lng, lat]: LngLat,
  heading_deg: number,
  [port_m, starboard_m]: readonly [number, number],
): [LngLat, LngLat] {
  const scale = metresPerDegree(lat);
  const turn = (heading_deg * Math.PI) / 180;
  const at = (away_m: number): LngLat => [
    lng + (away_m * Math.cos(turn)) / scale.east,
    lat - (away_m * Math.sin(turn)) / scale.north,
  ];
  return [at(-port_m), at(starboard_m)];
}

type Holiday = Holidays["features"][number];

export const ringsOf = ({ geometry }: Holiday): LngLat[][] => geometry.coordinates.flat();

/** A holiday with as much about it as shows where it lies. */
export function aboutHoliday(holiday: Holiday): Bounds | null {
  const bounds = boundsOf(ringsOf(holiday).flat());
  if (!bounds) return null;
  const [west, south, east, north] = bounds;
  const [across, along] = [east - west, north - south];
  return [west - across, south - along, east + across, north + along];
}
