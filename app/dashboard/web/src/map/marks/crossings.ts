/** Where lines cross and disagree, as the map shows it. Pure. */

import type { CrossingView, CrossoversView, LngLat } from "../../api/types";
import { type Bounds, metresPerDegree } from "../geo";

/** What is shown about a crossing to each side. */
const ABOUT_M = 25;

/** Crossings that disagree, worst first. */
export const outliersOf = ({ features }: Pick<CrossoversView, "features">): CrossingView[] =>
  features.features.map(({ properties }) => properties).filter(({ outlier }) => outlier);

export const placeOf = ({ lon_deg, lat_deg }: Pick<CrossingView, "lon_deg" | "lat_deg">): LngLat => [
  lon_deg,
  lat_deg,
];

/** A crossing with as much about it as shows where it lies. */
export function aboutCrossing({ lon_deg, lat_deg }: Pick<CrossingView, "lon_deg" | "lat_deg">): Bounds {
  const { east, north } = metresPerDegree(lat_deg);
  const [across, along] = [ABOUT_M / east, ABOUT_M / north];
  return [lon_deg - across, lat_deg - along, lon_deg + across, lat_deg + along];
}

export interface Bar {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** Bars of counts, as high as their share of the largest, in a picture of this size. */
export function barsOf(counts: readonly number[], width: number, height: number): Bar[] {
  const most = Math.max(1, ...counts);
  const each = width / Math.max(1, counts.length);
  return counts.map((n, i) => ({
    x: i * each,
    y: height * (1 - n / most),
    width: each,
    height: (height * n) / most,
  }));
}
