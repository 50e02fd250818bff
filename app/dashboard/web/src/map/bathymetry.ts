/** Turns the map's grid into pictures and shapes. Pure, so that it can be tested without a map. */

import type { MapView } from "../api/types";
import { colourAt, DEEP, type Palette, roundRange, VIOLET } from "./palette";

export type Layer = "depth" | "uncertainty";

export interface Range {
  low: number;
  high: number;
}

export const PALETTES: Record<Layer, Palette> = { depth: DEEP, uncertainty: VIOLET };

export function gridOf(map: MapView, layer: Layer): (number | null)[][] {
  return layer === "depth" ? map.depth_m : map.sd_m;
}

/** A pleasant range that holds all of a layer's values; null while there are none. */
export function fittingRange(map: MapView, layer: Layer): Range | null {
  let low = Number.POSITIVE_INFINITY;
  let high = Number.NEGATIVE_INFINITY;
  for (const row of gridOf(map, layer)) {
    for (const value of row) {
      if (value === null) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (low > high) return null;
  const [from, to] = roundRange(layer === "uncertainty" ? 0 : low, high);
  return { low: from, high: to > from ? to : from + 1 };
}

/** Colours of a layer as RGBA, one pixel per cell, the northern row first; unknown cells are transparent. */
export function paint(map: MapView, layer: Layer, { low, high }: Range): Uint8ClampedArray<ArrayBuffer> {
  const pixels = new Uint8ClampedArray(map.rows * map.cols * 4);
  const table = Array.from({ length: 256 }, (_, i) => colourAt(PALETTES[layer], i, 0, 255));
  const scale = 255 / (high - low);
  gridOf(map, layer).forEach((row, r) => {
    let at = (map.rows - 1 - r) * map.cols * 4;
    for (const value of row) {
      if (value !== null) {
        const colour = table[Math.round(Math.min(255, Math.max(0, (value - low) * scale)))];
        if (colour) pixels.set(colour, at);
        pixels[at + 3] = 255;
      }
      at += 4;
    }
  });
  return pixels;
}

/** Columns [west, east) and rows [south, north) of cells. */
export interface Block {
  west: number;
  south: number;
  east: number;
  north: number;
}

/** The cells that were filled in between soundings, as rectangles that cover each of them once. */
export function interpolatedBlocks(map: MapView): Block[] {
  const blocks: Block[] = [];
  let open = new Map<string, Block>();
  for (let row = 0; row < map.rows; row++) {
    const next = new Map<string, Block>();
    for (const [west, east] of interpolatedRuns(map, row)) {
      const key = `${west}:${east}`;
      const below = open.get(key);
      if (below) {
        below.north = row + 1;
        next.set(key, below);
      } else {
        const block = { west, south: row, east, north: row + 1 };
        blocks.push(block);
        next.set(key, block);
      }
    }
    open = next;
  }
  return blocks;
}

function interpolatedRuns(map: MapView, row: number): [west: number, east: number][] {
  const runs: [number, number][] = [];
  let start = -1;
  for (let col = 0; col <= map.cols; col++) {
    const hatched = col < map.cols && map.depth_m[row]?.[col] != null && !map.sounded[row]?.[col];
    if (hatched && start < 0) start = col;
    if (!hatched && start >= 0) {
      runs.push([start, col]);
      start = -1;
    }
  }
  return runs;
}
