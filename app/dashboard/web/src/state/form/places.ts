/** Places of a draft: rings that come to it, and its area as a rectangle. Pure. */

import type { LngLat } from "../../api/types";
import { sizeOf } from "../../map/area";
import { boundsOf } from "../../map/geo";
import { cornersOf, type Draft } from "./draft";

type Rings = readonly (readonly LngLat[])[];

/** Rings with further ones; what is there already is not there twice. */
export function withRings(rings: Rings, further: Rings): Rings {
  const known = new Set(rings.map((ring) => ring.join()));
  return [...rings, ...further.filter((ring) => !known.has(ring.join()))];
}

/** The area as a rectangle that is typed: the one that reaches as far as what was drawn. */
export function asTyped(draft: Draft): Partial<Draft> {
  const corners = cornersOf(draft);
  const bounds = boundsOf(corners);
  if (!bounds || corners.length < 3) return { source: "typed" };
  const [west, south, east] = bounds;
  // Its sizes are measured along its southern side.
  const { east_m } = sizeOf([
    [west, south],
    [east, south],
  ]);
  const { north_m } = sizeOf(corners);
  return {
    source: "typed",
    longitude: west.toFixed(7),
    latitude: south.toFixed(7),
    east_m: String(Number(east_m.toFixed(1))),
    north_m: String(Number(north_m.toFixed(1))),
  };
}
