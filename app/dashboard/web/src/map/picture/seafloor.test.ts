import { describe, expect, it } from "vitest";
import type { LayerView, LngLat } from "../../api/types";
import { contours } from "./contours";
import { drawnShares } from "./drawings";
import { LANDMARKS } from "./landmarks";
import { fittingRange, shareOutside } from "./layerColours";
import { roundRange } from "./palette";
import { differenceOf, placeIn, readCell, type SeaFloor, UNKNOWN, valueAt, withTiles } from "./seafloor";

const CORNERS: LngLat[] = [
  [1, 3],
  [4, 3],
  [4, 1],
  [1, 1],
];

/** An answer as the service writes it: tiles of two cells, depths in centimetres. */
function answer(
  cells: Record<number, { depth: number[]; flags?: number[] }>,
  header: Record<string, unknown> = {},
): ArrayBuffer {
  const layers = ["depth", "uncertainty", "count", "flags"];
  const text = JSON.stringify({
    tag: "a.1",
    base: null,
    version: 1,
    step: 1,
    rows: 2,
    cols: 3,
    cell_m: 2,
    west_m: 10,
    south_m: 20,
    corners: CORNERS,
    vertical_datum: "",
    min_depth_m: 1,
    max_depth_m: 9,
    accuracy_m: 0.25,
    tile: 2,
    tiles: Object.keys(cells).map(Number),
    layers,
    scales: [100, 1000, 1, 1],
    ...header,
  });
  const head = new TextEncoder().encode(text);
  const padding = (4 - (head.length % 4)) % 4;
  const numbers = Object.values(cells).flatMap(({ depth, flags }) => [
    ...depth,
    ...depth.map((d) => (d === UNKNOWN ? UNKNOWN : 100)),
    ...depth.map(() => 1),
    ...(flags ?? depth.map((d) => (d === UNKNOWN ? UNKNOWN : 1))),
  ]);
  const bytes = new Uint8Array(8 + head.length + padding + 4 * numbers.length);
  bytes.set(new TextEncoder().encode("BFM1"));
  new DataView(bytes.buffer).setUint32(4, head.length, true);
  bytes.set(head, 8);
  new Int32Array(bytes.buffer, 8 + head.length + padding).set(numbers);
  return bytes.buffer;
}

/** 1 2 | 3 above 4 5 | 6 below, in metres; the tile on the right is one cell wide. */
const whole = () =>
  withTiles(null, answer({ 0: { depth: [400, 500, 100, 200] }, 1: { depth: [600, 300] } })) as SeaFloor;

describe("the map from its tiles", () => {
  it("is put together with row 0 in the south, cut off at its edges", () => {
    const map = whole();
    expect([0, 1].map((row) => [0, 1, 2].map((col) => valueAt(map, "depth", row, col)))).toEqual([
      [4, 5, 6],
      [1, 2, 3],
    ]);
    expect(valueAt(map, "uncertainty", 0, 0)).toBe(0.1);
    expect(valueAt(map, "depth", 2, 0)).toBeNull();
    expect(valueAt(map, "slope", 0, 0)).toBeNull();
  });

  it("takes up what changed and keeps the rest", () => {
    const next = withTiles(whole(), answer({ 1: { depth: [UNKNOWN, 350] } }, { base: "a.1", tag: "a.2" }));
    expect(next?.tag).toBe("a.2");
    expect([valueAt(next as SeaFloor, "depth", 0, 2), valueAt(next as SeaFloor, "depth", 1, 2)]).toEqual([
      null,
      3.5,
    ]);
    expect(valueAt(next as SeaFloor, "depth", 0, 0)).toBe(4);
  });

  it("refuses changes of a map that it does not have", () => {
    const changes = answer({ 1: { depth: [600, 300] } }, { base: "a.7", tag: "a.8" });
    expect(withTiles(whole(), changes)).toBeNull();
    expect(withTiles(null, changes)).toBeNull();
    expect(() => withTiles(null, new ArrayBuffer(12))).toThrow("not known");
  });
});

describe("reading the map at a place", () => {
  it("finds the cell, and says how it is known", () => {
    const map = whole();
    expect(readCell(map, [1.5, 1.5])).toMatchObject({ depth_m: 4, sd_m: 0.1, count: 1, sounded: true });
    expect(readCell(map, [2.5, 2])).toMatchObject({ east_m: 13, north_m: 22 });
    expect(readCell(map, [0.9, 2])).toBeNull();
    expect(readCell(map, [2, 3.1])).toBeNull();
  });

  it("undoes placing a point by its share of the grid, also when the grid is turned", () => {
    const turned: SeaFloor = {
      ...whole(),
      corners: [
        [0, 2],
        [2, 3],
        [3, 1],
        [1, 0],
      ],
    };
    const cell = readCell(turned, placeIn(turned.corners, 0.5, 0.25));
    expect(cell?.east_m).toBeCloseTo(13);
    expect(cell?.north_m).toBeCloseTo(21);
  });
});

it("compares two maps where both know the bottom", () => {
  const other = withTiles(null, answer({ 0: { depth: [350, 500, 100, UNKNOWN] }, 1: { depth: [600, 300] } }));
  expect(differenceOf(whole(), other as SeaFloor)).toMatchObject({ cells: 5, bias_m: 0.1, largest_m: 0.5 });
  expect(
    differenceOf(whole(), { ...(other as SeaFloor), corners: CORNERS.map(([x, y]) => [x + 9, y]) }),
  ).toBeNull();
});

const layer = (name: string, changes: Partial<LayerView> = {}): LayerView => ({
  name,
  title: name,
  meaning: "",
  unit: "metre",
  palette: "deep",
  fit: "data",
  range: null,
  classes: [],
  scale: 100,
  in_every_tile: true,
  in_json: true,
  in_pictures: true,
  in_files: true,
  of_depths: true,
  absence: "",
  remedy: "",
  ...changes,
});

describe("ranges", () => {
  it("hold all values with pleasant ends, from where the layer says, unless they are fixed", () => {
    expect(fittingRange(whole(), layer("depth"))).toEqual({ low: 1, high: 6 });
    expect(fittingRange(whole(), layer("uncertainty", { fit: "from_zero" }))?.low).toBe(0);
    expect(fittingRange(whole(), layer("depth", { fit: "about_zero" }))).toEqual({ low: -6, high: 6 });
    expect(fittingRange(whole(), layer("flags", { range: [0, 2] }))).toEqual({ low: 0, high: 2 });
    expect(fittingRange(whole(), layer("difference"))).toBeNull();
  });

  it("of depths hold what was measured, while anything was", () => {
    const cells = { depth: [100, 900, 300, 700], flags: [1, 0, 2, 8] };
    const guessed = withTiles(null, answer({ 0: cells }, { cols: 2, tile: 2 })) as SeaFloor;
    expect(fittingRange(guessed, layer("depth"))).toEqual({ low: 1, high: 3 });
    expect(fittingRange(guessed, layer("depth", { of_depths: false }))).toEqual({ low: 0, high: 10 });
    const nothing = withTiles(null, answer({ 0: { ...cells, flags: [0, 0, 0, 8] } }, { cols: 2, tile: 2 }));
    expect(fittingRange(nothing as SeaFloor, layer("depth"))).toEqual({ low: 0, high: 10 });
  });

  it("tell how much of the map lies outside", () => {
    expect(shareOutside(whole(), layer("depth"), { low: 1.5, high: 5 })).toBeCloseTo(2 / 6);
  });

  it("are one, two or five times a power of ten apart", () => {
    expect(roundRange(7.3, 12.9)).toEqual([6, 14]);
    expect(roundRange(3, 3)).toEqual([3, 3]);
  });
});

it("landmarks are never seen, visible or accurate", () => {
  const flags = [0, 8, 8 | 4, 1 | 8 | 4];
  const map = withTiles(null, answer({ 0: { depth: [1, 1, 1, 1], flags } }, { cols: 2, tile: 2 }));
  expect(drawnShares(map as SeaFloor, "flags", LANDMARKS)).toEqual([0.25, 0.25, 0.5]);
});

describe("contours", () => {
  const cone = (rows: number, cols: number) =>
    Int32Array.from({ length: rows * cols }, (_, i) => {
      const [row, col] = [Math.floor(i / cols) - rows / 2 + 0.5, (i % cols) - cols / 2 + 0.5];
      return Math.round(100 * Math.hypot(row, col));
    });

  it("of a cone are closed rings at their radius", () => {
    const found = contours(cone(21, 21), 21, 21, 300);
    const rings = found.filter(({ level }) => level === 300 || level === 600);
    expect(rings).toHaveLength(2);
    for (const { level, points } of rings) {
      expect(points.at(0)).toEqual(points.at(-1));
      for (const [col, row] of points) {
        expect(Math.hypot(col - 10.5, row - 10.5)).toBeCloseTo(level / 100, 0);
      }
    }
  });

  it("end where nothing is known", () => {
    const values = cone(21, 21);
    for (let col = 0; col < 21; col++) values[10 * 21 + col] = UNKNOWN;
    const [first] = contours(values, 21, 21, 300).filter(({ level }) => level === 300);
    expect(first?.points.at(0)).not.toEqual(first?.points.at(-1));
  });

  it("of a plane are as many straight lines as levels", () => {
    const plane = Int32Array.from({ length: 100 }, (_, i) => 10 * (i % 10));
    const found = contours(plane, 10, 10, 20);
    expect(found.map(({ level }) => level)).toEqual([20, 40, 60, 80]);
    for (const { level, points } of found) {
      expect(points).toHaveLength(10);
      for (const [col] of points) expect(col).toBeCloseTo(level / 10 + 0.5);
    }
  });
});
