/** The way of a plan, cut in two. Pure. */

import type { LngLat } from "../../api/types";
import { wayBetween } from "../geo";

/** A way up to so many metres along it, and the rest; null: all of it, and nothing. */
export function cutAt(way: readonly LngLat[], at_m: number | null): [LngLat[], LngLat[]] {
  if (at_m === null) return [[...way], []];
  let left_m = at_m;
  for (let i = 1; i < way.length; i++) {
    const [a, b] = [way[i - 1] as LngLat, way[i] as LngLat];
    const { metres } = wayBetween(a, b);
    if (metres > left_m) {
      const share = left_m / metres;
      const turn: LngLat = [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
      return [
        [...way.slice(0, i), turn],
        [turn, ...way.slice(i)],
      ];
    }
    left_m -= metres;
  }
  return [[...way], []];
}
