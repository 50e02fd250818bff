/** Layers that are drawn by classes of their own instead of by a scale of colours, by the palette that they name. Pure. */

import type { LayerView } from "../../api/types";
import { LANDMARKS } from "./landmarks";
import type { Rgb } from "./palette";
import { type SeaFloor, UNKNOWN } from "./seafloor";

export interface Drawing {
  words: () => readonly string[];
  /** A colour for each of the words. */
  colours: readonly Rgb[];
  /** Which of them a value of the layer belongs to. */
  classOf: (value: number) => number;
}

const DRAWINGS = { landmarks: LANDMARKS } satisfies Partial<Record<LayerView["palette"], Drawing>>;

export type Drawn = keyof typeof DRAWINGS;

/** Which drawing a layer has; null: it is drawn by colours. */
export function drawnBy({ palette }: Pick<LayerView, "palette">): Drawn | null {
  return palette in DRAWINGS ? (palette as Drawn) : null;
}

export const drawingOf = (name: Drawn): Drawing => DRAWINGS[name];

/** Share of the cells in each of a drawing's classes; none while the map is not there. */
export function drawnShares(map: SeaFloor, layer: string, { words, classOf }: Drawing): number[] {
  const counts = words().map(() => 0);
  let all = 0;
  for (const value of map.layers[layer] ?? []) {
    if (value === UNKNOWN) continue;
    const at = classOf(value);
    counts[at] = (counts[at] ?? 0) + 1;
    all += 1;
  }
  return all === 0 ? [] : counts.map((count) => count / all);
}
