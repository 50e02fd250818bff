/** Places where tracks were held against what others sounded there, as a picture of their own. Pure. */

import type { AdjustmentView, LngLat, TieView } from "../../api/types";
import { metresPerDegree } from "../geo";

export interface DrawnTie {
  x: number;
  y: number;
  place: LngLat;
  tie: TieView;
}

/** Ties in a picture so wide, north up and to scale, no higher than it is wide; and how high it is. */
export function tiesIn(
  { ties }: Pick<AdjustmentView, "ties">,
  width: number,
): { height: number; drawn: DrawnTie[] } {
  const places = ties.features.map(({ geometry }) => geometry.coordinates as LngLat);
  if (places.length === 0) return { height: 0, drawn: [] };
  const [lngs, lats] = [places.map(([lng]) => lng), places.map(([, lat]) => lat)];
  const [west, north] = [Math.min(...lngs), Math.max(...lats)];
  const scale = metresPerDegree(north);
  const across_m = (Math.max(...lngs) - west) * scale.east;
  const along_m = (north - Math.min(...lats)) * scale.north;
  const each = width / Math.max(across_m, along_m, 1);
  const aside = (width - each * across_m) / 2;
  return {
    height: each * along_m,
    drawn: ties.features.map(({ properties }, i) => {
      const [lng, lat] = places[i] as LngLat;
      return {
        x: aside + each * (lng - west) * scale.east,
        y: each * (north - lat) * scale.north,
        place: [lng, lat],
        tie: properties,
      };
    }),
  };
}
