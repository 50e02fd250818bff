/** Moving targets on the map: where each is thought to be, and the ellipse that holds it with 95 %. Pure. */

import type { LngLat, TargetView } from "../../api/types";
import { metresPerDegree } from "../geo";

const CORNERS = 60;

type Ellipse = NonNullable<TargetView["ellipse"]>;

/** The ellipse as a closed line. */
export function ellipseRing([lng, lat]: LngLat, ellipse: Ellipse): LngLat[] {
  const scale = metresPerDegree(lat);
  const turn = (ellipse.orientation_deg * Math.PI) / 180;
  return Array.from({ length: CORNERS + 1 }, (_, i): LngLat => {
    const angle = (i * 2 * Math.PI) / CORNERS;
    const along = ellipse.semi_major_m * Math.cos(angle);
    const across = ellipse.semi_minor_m * Math.sin(angle);
    const east = along * Math.sin(turn) + across * Math.cos(turn);
    const north = along * Math.cos(turn) - across * Math.sin(turn);
    return [lng + east / scale.east, lat + north / scale.north];
  });
}

/** What is drawn of a target; `ring` is empty where no ellipse is known. */
export interface TargetMark {
  name: string;
  accurate: boolean;
  at: LngLat;
  ring: readonly LngLat[];
}

export function targetMarks(targets: readonly TargetView[]): TargetMark[] {
  return targets.flatMap(({ name, accurate, lon_deg, lat_deg, ellipse }) => {
    if (lon_deg === null || lat_deg === null) return [];
    const at: LngLat = [lon_deg, lat_deg];
    return [{ name, accurate, at, ring: ellipse ? ellipseRing(at, ellipse) : [] }];
  });
}
