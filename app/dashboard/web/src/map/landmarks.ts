/** How well each cell is known: the layer that is drawn by classes instead of by a scale of colours. Pure. */

import { say } from "../words/say";
import type { Rgb } from "./palette";
import { ACCURATE, type SeaFloor, UNKNOWN, VISIBLE } from "./seafloor";

export const landmarkWords = (): readonly string[] => [
  say("landmark.unseen"),
  say("landmark.visible"),
  say("landmark.accurate"),
];

/** As in the papers' figure: never seen, visible, accurate. */
export const LANDMARK_COLOURS: readonly Rgb[] = [
  [176, 58, 46],
  [244, 196, 80],
  [46, 125, 110],
];

/** 0: never seen, 1: visible, 2: accurate. */
export function landmarkState(flags: number): 0 | 1 | 2 {
  return flags & ACCURATE ? 2 : flags & VISIBLE ? 1 : 0;
}

/** Share of the cells in each state; null while the map is not there. */
export function landmarkShares(map: SeaFloor): [number, number, number] | null {
  const counts: [number, number, number] = [0, 0, 0];
  let all = 0;
  for (const flags of map.layers.flags ?? []) {
    if (flags === UNKNOWN) continue;
    counts[landmarkState(flags)] += 1;
    all += 1;
  }
  return all === 0 ? null : (counts.map((count) => count / all) as [number, number, number]);
}
