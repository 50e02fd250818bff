/** The map as this page holds it: whole numbers per cell and layer, kept up to date with the tiles that changed. */

import type { LngLat, Place } from "../../api/types";
import { say } from "../../words/say";

export const SOUNDED = 1;
export const PRIOR = 2;
export const ACCURATE = 4;
export const VISIBLE = 8;
/** Stands for a cell without a value. */
export const UNKNOWN = -(2 ** 31);

interface Header {
  tag: string;
  base: string | null;
  version: number;
  step: number;
  rows: number;
  cols: number;
  cell_m: number;
  west_m: number;
  south_m: number;
  corners: LngLat[];
  vertical_datum: string;
  min_depth_m: number | null;
  max_depth_m: number | null;
  accuracy_m: number;
  tile: number;
  tiles: number[];
  layers: string[];
  scales: number[];
}

/** Row 0 is south, column 0 is west; a value is a layer's number divided by its scale. */
export interface SeaFloor extends Omit<Header, "tiles" | "base" | "layers" | "scales"> {
  layers: Readonly<Partial<Record<string, Int32Array<ArrayBuffer>>>>;
  scales: Readonly<Partial<Record<string, number>>>;
}

/** Puts an answer of the service over what was known; null when it builds on something else than that. */
export function withTiles(known: SeaFloor | null, answer: ArrayBuffer): SeaFloor | null {
  const view = new DataView(answer);
  if (answer.byteLength < 8 || view.getUint32(0) !== 0x42464d31)
    throw new Error(say("seafloor.theMapSFormIsNot"));
  const length = view.getUint32(4, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(answer, 8, length))) as Header;
  const { tiles, base, layers: names, scales, ...rest } = header;
  if (base !== null && base !== known?.tag) return null;
  const size = header.rows * header.cols;
  const layers: Partial<Record<string, Int32Array<ArrayBuffer>>> = {};
  for (const name of names) {
    const before = base === null ? undefined : known?.layers[name];
    if (base !== null && !before) return null;
    layers[name] = before ?? new Int32Array(size).fill(UNKNOWN);
  }
  const across = Math.ceil(header.cols / header.tile);
  let at = 8 + length + ((4 - (length % 4)) % 4);
  for (const number of tiles) {
    const south = Math.floor(number / across) * header.tile;
    const west = (number % across) * header.tile;
    const rows = Math.min(header.tile, header.rows - south);
    const cols = Math.min(header.tile, header.cols - west);
    for (const name of names) {
      const cells = new Int32Array(answer, at, rows * cols);
      const into = layers[name] as Int32Array;
      for (let row = 0; row < rows; row++) {
        into.set(cells.subarray(row * cols, (row + 1) * cols), (south + row) * header.cols + west);
      }
      at += 4 * rows * cols;
    }
  }
  return { ...rest, layers, scales: Object.fromEntries(names.map((name, i) => [name, scales[i] ?? 1])) };
}

/** A layer's value in a cell; null where there is none. */
export function valueAt(map: SeaFloor, layer: string, row: number, col: number): number | null {
  if (row < 0 || col < 0 || row >= map.rows || col >= map.cols) return null;
  const value = map.layers[layer]?.[row * map.cols + col];
  return value === undefined || value === UNKNOWN ? null : value / (map.scales[layer] ?? 1);
}

export interface CellReading {
  east_m: number;
  north_m: number;
  depth_m: number | null;
  sd_m: number | null;
  count: number;
  sounded: boolean;
  imported: boolean;
}

/** Row and column of a place, with fractions; null outside the grid, which is a parallelogram between its corners. */
export function cellOf(map: SeaFloor, place: Place): { row: number; col: number } | null {
  const { row, col } = gridPlace(map, place);
  return row >= 0 && row < map.rows && col >= 0 && col < map.cols ? { row, col } : null;
}

/** Row and column of a place, with fractions, also outside the grid. */
export function gridPlace(
  map: Pick<SeaFloor, "corners" | "rows" | "cols">,
  [lng, lat]: Place,
): { row: number; col: number } {
  const [northWest, , southEast, southWest] = map.corners as [LngLat, LngLat, LngLat, LngLat];
  const eastward = [southEast[0] - southWest[0], southEast[1] - southWest[1]] as const;
  const northward = [northWest[0] - southWest[0], northWest[1] - southWest[1]] as const;
  const to = [lng - southWest[0], lat - southWest[1]] as const;
  const determinant = eastward[0] * northward[1] - eastward[1] * northward[0];
  const u = (to[0] * northward[1] - to[1] * northward[0]) / determinant;
  const v = (eastward[0] * to[1] - eastward[1] * to[0]) / determinant;
  return { row: v * map.rows, col: u * map.cols };
}

/** What the map says at a place; null outside its grid. */
export function readCell(map: SeaFloor, place: LngLat): CellReading | null {
  const cell = cellOf(map, place);
  if (!cell) return null;
  const row = Math.floor(cell.row);
  const col = Math.floor(cell.col);
  const flags = valueAt(map, "flags", row, col) ?? 0;
  return {
    east_m: map.west_m + cell.col * map.cell_m,
    north_m: map.south_m + cell.row * map.cell_m,
    depth_m: valueAt(map, "depth", row, col),
    sd_m: valueAt(map, "uncertainty", row, col),
    count: valueAt(map, "count", row, col) ?? 0,
    sounded: (flags & SOUNDED) !== 0,
    imported: (flags & PRIOR) !== 0,
  };
}

/** A place inside a parallelogram given by a map's corners; u and v run from 0 (west, south) to 1 (east, north). */
export function placeIn(corners: readonly LngLat[], u: number, v: number): LngLat {
  const [northWest, , southEast, southWest] = corners as [LngLat, LngLat, LngLat, LngLat];
  return [
    southWest[0] + u * (southEast[0] - southWest[0]) + v * (northWest[0] - southWest[0]),
    southWest[1] + u * (southEast[1] - southWest[1]) + v * (northWest[1] - southWest[1]),
  ];
}

/** How two maps differ where both know the bottom: this minus the other, metres. */
export interface MapDifference {
  cells: number;
  rmse_m: number;
  bias_m: number;
  largest_m: number;
}

export function differenceOf(map: SeaFloor, other: SeaFloor): MapDifference | null {
  let cells = 0;
  let sum = 0;
  let squares = 0;
  let largest_m = 0;
  for (let row = 0; row < map.rows; row++) {
    for (let col = 0; col < map.cols; col++) {
      const depth = valueAt(map, "depth", row, col);
      if (depth === null) continue;
      const cell = cellOf(other, placeIn(map.corners, (col + 0.5) / map.cols, (row + 0.5) / map.rows));
      const its = cell && valueAt(other, "depth", Math.floor(cell.row), Math.floor(cell.col));
      if (its === null) continue;
      const difference = depth - its;
      cells += 1;
      sum += difference;
      squares += difference ** 2;
      largest_m = Math.max(largest_m, Math.abs(difference));
    }
  }
  return cells === 0 ? null : { cells, rmse_m: Math.sqrt(squares / cells), bias_m: sum / cells, largest_m };
}
