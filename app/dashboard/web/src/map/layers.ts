/** What can be shown of the map: each layer's title, unit, colours and range. Pure. */

import {
  BALANCE,
  DEPTH_PALETTES,
  type DepthPalette,
  LANDMARK_COLOURS,
  MATTER,
  type Palette,
  roundRange,
  VIOLET,
} from "./palette";
import { ACCURATE, type LayerName, type SeaFloor, UNKNOWN, VISIBLE } from "./seafloor";

export type Shown = "depth" | "uncertainty" | "count" | "landmarks" | "slope" | "tvu_fraction" | "difference";

export interface Range {
  low: number;
  high: number;
}

interface Kind {
  title: string;
  /** What the numbers say, for the legend's tip. */
  meaning: string;
  unit: string;
  source: LayerName;
  /** Has to be asked of the service beside the usual layers. */
  further?: boolean;
}

export const KINDS: Record<Shown, Kind> = {
  depth: {
    title: "Depth",
    meaning: "Depth below the mission's datum",
    unit: "m",
    source: "depth",
  },
  uncertainty: {
    title: "Uncertainty",
    meaning: "Standard deviation of the depth",
    unit: "m",
    source: "uncertainty",
  },
  count: { title: "Soundings", meaning: "Soundings in each cell", unit: "", source: "count" },
  landmarks: {
    title: "Landmarks",
    meaning: "Never seen, seen but not known well enough, known to the asked accuracy",
    unit: "",
    source: "flags",
  },
  difference: {
    title: "Difference",
    meaning: "Depth minus the reference grid's depth",
    unit: "m",
    source: "difference",
    further: true,
  },
  slope: {
    title: "Slope",
    meaning: "Inclination of the sea floor",
    unit: "°",
    source: "slope",
    further: true,
  },
  tvu_fraction: {
    title: "TVU / 1a",
    meaning: "TVU estimate (95 %) over the largest of S-44 Order 1a; below 1 it is within",
    unit: "",
    source: "tvu_fraction",
    further: true,
  },
};

export const LANDMARK_WORDS = ["never seen", "visible", "accurate"] as const;

export function paletteOf(layer: Shown, depth: DepthPalette): Palette {
  switch (layer) {
    case "depth":
      return DEPTH_PALETTES[depth].palette;
    case "uncertainty":
      return VIOLET;
    case "difference":
    case "tvu_fraction":
      return BALANCE;
    default:
      return MATTER;
  }
}

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

/** A pleasant range that holds all of a layer's values; null while there are none. */
export function fittingRange(map: SeaFloor, layer: Shown): Range | null {
  if (layer === "landmarks") return map.layers.flags ? { low: 0, high: 2 } : null;
  if (layer === "tvu_fraction") return map.layers.tvu_fraction ? { low: 0, high: 2 } : null;
  const { source } = KINDS[layer];
  const scale = map.scales[source] ?? 1;
  let low = Number.POSITIVE_INFINITY;
  let high = Number.NEGATIVE_INFINITY;
  for (const value of map.layers[source] ?? []) {
    if (value === UNKNOWN) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return null;
  if (layer === "difference") {
    const [, to] = roundRange(0, Math.max(Math.abs(low), Math.abs(high), 1) / scale);
    return { low: -to, high: to };
  }
  const [from, to] = roundRange(layer === "depth" ? low / scale : 0, high / scale);
  return { low: from, high: to > from ? to : from + 1 };
}

export function shareOutside(map: SeaFloor, layer: Shown, { low, high }: Range): number {
  const { source } = KINDS[layer];
  const scale = map.scales[source] ?? 1;
  let all = 0;
  let outside = 0;
  for (const value of map.layers[source] ?? []) {
    if (value === UNKNOWN) continue;
    all += 1;
    if (value < low * scale || value > high * scale) outside += 1;
  }
  return all === 0 ? 0 : outside / all;
}

export { LANDMARK_COLOURS };

/** What is wrong with the two ends of a colour range as typed; empty when it can be taken. */
export function rangeFault(low: string, high: string): string {
  const ends = [low, high].map((text) => (text.trim() === "" ? Number.NaN : Number(text)));
  const [from, to] = ends as [number, number];
  if (!Number.isFinite(from) || !Number.isFinite(to)) return "Both ends need a number";
  return from < to ? "" : `The lower end, ${low.trim()}, must be below the upper one, ${high.trim()}`;
}
