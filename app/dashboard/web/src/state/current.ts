/** The current, as the vehicles estimate it, in words. Pure. */

import type { CurrentView } from "../api/types";
import { direction, speed } from "./format";

/** Below that it is no current, and goes nowhere. */
const STILL_MPS = 0.05;

/** "0.3 m/s → 074°", and where an arrow points, degrees from north; null: it does not flow. */
export function currentWords({ speed_mps, toward_deg }: CurrentView): {
  words: string;
  arrow_deg: number | null;
} {
  return speed_mps < STILL_MPS
    ? { words: speed(speed_mps), arrow_deg: null }
    : { words: `${speed(speed_mps)} → ${direction(toward_deg)}°`, arrow_deg: toward_deg };
}
