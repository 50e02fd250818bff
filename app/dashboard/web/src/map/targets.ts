/** Moving targets on the map: where each is thought to be, and the ellipse that holds it with 95 %. Pure. */

import type { LngLat, TargetView } from "../api/types";
import { metresPerDegree } from "./geo";
import { type Feature, feature, line, point } from "./style";

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

export function targetFeatures(targets: readonly TargetView[]): Feature[] {
  return targets.flatMap((target) => {
    if (target.lon_deg === null || target.lat_deg === null) return [];
    const at: LngLat = [target.lon_deg, target.lat_deg];
    const facts = { name: target.name, accurate: target.accurate ? 1 : 0 };
    return [
      ...(target.ellipse ? [feature(line(ellipseRing(at, target.ellipse)), facts)] : []),
      feature(point(at), facts),
    ];
  });
}
