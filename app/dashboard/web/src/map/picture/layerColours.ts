/** What can be shown of the map, as the service declares it: each layer's colours and range. Pure. */

import type { LayerView } from "../../api/types";
import { say } from "../../words/say";
import { isMeasured } from "./certainty";
import { DEPTH_PALETTES, type DepthPalette, PALETTES, type Palette, roundRange } from "./palette";
import { type SeaFloor, UNKNOWN } from "./seafloor";

export interface Range {
  low: number;
  high: number;
}

const SYMBOLS: Readonly<Record<string, string>> = { metre: "m", degree: "°", "1": "" };

export function symbolOf({ unit }: LayerView): string {
  return SYMBOLS[unit] ?? unit;
}

/** The layer's colours, of depths those that the operator chose; of a drawing of its own any, for nothing asks for them. */
export function paletteOf({ palette }: LayerView, depth: DepthPalette): Palette {
  return palette in PALETTES ? PALETTES[palette as keyof typeof PALETTES] : DEPTH_PALETTES[depth].palette;
}

/**
 * A pleasant range that holds all of a layer's values, of one that is of depths those that were measured: what is guessed
 * may be anything. Null while there are none.
 */
export function fittingRange(map: SeaFloor, layer: LayerView): Range | null {
  const values = map.layers[layer.name];
  if (layer.range && values?.some((value) => value !== UNKNOWN)) {
    return { low: layer.range[0], high: layer.range[1] };
  }
  const scale = map.scales[layer.name] ?? 1;
  let low = Number.POSITIVE_INFINITY;
  let high = Number.NEGATIVE_INFINITY;
  const { flags } = map.layers;
  const measured = layer.of_depths && flags?.some(isMeasuredCell) ? flags : null;
  values?.forEach((value, at) => {
    if (value === UNKNOWN || (measured && !isMeasuredCell(measured[at] as number))) return;
    if (value < low) low = value;
    if (value > high) high = value;
  });
  if (low > high) return null;
  if (layer.fit === "about_zero") {
    const [, to] = roundRange(0, Math.max(Math.abs(low), Math.abs(high), 1) / scale);
    return { low: -to, high: to };
  }
  const [from, to] = roundRange(layer.fit === "data" ? low / scale : 0, high / scale);
  return { low: from, high: to > from ? to : from + 1 };
}

const isMeasuredCell = (flags: number) => flags !== UNKNOWN && isMeasured(flags);

/** Share of the cells with each of the values 0, 1, 2 and so on. */
export function classShares(map: SeaFloor, { name, classes }: LayerView): number[] {
  const counts = classes.map(() => 0);
  let all = 0;
  for (const value of map.layers[name] ?? []) {
    if (value === UNKNOWN) continue;
    counts[value] = (counts[value] ?? 0) + 1;
    all += 1;
  }
  return counts.map((one) => one / Math.max(all, 1));
}

export function shareOutside(map: SeaFloor, { name }: LayerView, { low, high }: Range): number {
  const scale = map.scales[name] ?? 1;
  let all = 0;
  let outside = 0;
  for (const value of map.layers[name] ?? []) {
    if (value === UNKNOWN) continue;
    all += 1;
    if (value < low * scale || value > high * scale) outside += 1;
  }
  return all === 0 ? 0 : outside / all;
}

/** What is wrong with the two ends of a colour range as typed; empty when it can be taken. */
export function rangeFault(low: string, high: string): string {
  const ends = [low, high].map((text) => (text.trim() === "" ? Number.NaN : Number(text)));
  const [from, to] = ends as [number, number];
  if (!Number.isFinite(from) || !Number.isFinite(to)) return say("layers.bothEndsNeedANumber");
  return from < to ? "" : say("layers.theLowerEndMustBeBelow", { low: low.trim(), high: high.trim() });
}
