/** How strongly the map shows what it does not know for sure. Pure. */

import type { Range } from "./layerColours";
import { PRIOR, SOUNDED } from "./seafloor";

/** Deviations of a guess: up to `full_m` it is drawn like a measurement, from `none_m` on nothing is drawn. */
export interface Certainty {
  full_m: number;
  none_m: number;
}

/** So many times the asked accuracy is worth showing whatever the colours say. */
const WORTH_SHOWING = 4;
/** A guess whose deviation is this share of all colours could have nearly any of them. */
const ANY_COLOUR = 0.2;

/** For a map that is to be known to `accuracy_m`, with depths in these colours. */
export function certaintyFor(accuracy_m: number, depths: Range): Certainty {
  const none_m = Math.max(WORTH_SHOWING * accuracy_m, ANY_COLOUR * (depths.high - depths.low));
  return { full_m: accuracy_m, none_m };
}

/** From 0, nothing, to 1, as a measurement; even in the logarithm of the deviation. */
export function strengthOf(sd: number, full: number, none: number): number {
  if (sd <= full) return 1;
  return sd >= none ? 0 : 1 - Math.log(sd / full) / Math.log(none / full);
}

/** Whether something was measured in the cell: by this mission, or in what it began with. */
export const isMeasured = (flags: number): boolean => (flags & (SOUNDED | PRIOR)) !== 0;
