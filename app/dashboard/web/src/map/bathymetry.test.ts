import { describe, expect, it } from "vitest";
import type { MapView } from "../api/types";
import { fittingRange, interpolatedBlocks, paint } from "./bathymetry";
import { colourAt, DEEP, roundRange } from "./palette";

function mapOf(depth_m: (number | null)[][], sounded: boolean[][]): MapView {
  const rows = depth_m.length;
  const cols = depth_m[0]?.length ?? 0;
  return {
    mission_id: "m",
    version: 1,
    step: 1,
    west_m: 0,
    south_m: 0,
    cell_m: 1,
    rows,
    cols,
    corners: [
      [0, 1],
      [1, 1],
      [1, 0],
      [0, 0],
    ],
    vertical_datum: "",
    min_depth_m: null,
    max_depth_m: null,
    model: "gp",
    depth_m,
    sd_m: depth_m.map((row) => row.map((value) => (value === null ? null : 0.37))),
    count: sounded.map((row) => row.map(Number)),
    sounded,
    layers: {},
  };
}

/** A repeatable pattern without structure. */
function noisy(rows: number, cols: number): MapView {
  let state = 7;
  const next = () => {
    state = (state * 1_103_515_245 + 12_345) % 2 ** 31;
    return state / 2 ** 31;
  };
  const depth = Array.from({ length: rows }, () =>
    Array.from({ length: cols }, () => (next() < 0.2 ? null : next())),
  );
  return mapOf(
    depth,
    depth.map((row) => row.map(() => next() < 0.4)),
  );
}

describe("painting", () => {
  const map = mapOf(
    [
      [10, null],
      [20, 30],
    ],
    [
      [true, false],
      [true, true],
    ],
  );
  const pixels = paint(map, "depth", { low: 10, high: 20 });
  const pixel = (x: number, y: number) => [...pixels.slice((y * 2 + x) * 4, (y * 2 + x) * 4 + 4)];

  it("puts the southern row at the bottom and leaves unknown cells clear", () => {
    expect(pixel(1, 1)).toEqual([0, 0, 0, 0]);
    expect(pixel(0, 1)).toEqual([...(DEEP.stops[0] ?? []), 255]);
  });

  it("gives depths beyond the range the colour of its end", () => {
    expect(pixel(0, 0)).toEqual([...(DEEP.stops.at(-1) ?? []), 255]);
    expect(pixel(1, 0)).toEqual(pixel(0, 0));
  });
});

describe("the range", () => {
  it("holds every value and is round", () => {
    const map = mapOf(
      [
        [11.3, null],
        [18.72, 14],
      ],
      [
        [true, true],
        [true, true],
      ],
    );
    expect(fittingRange(map, "depth")).toEqual({ low: 10, high: 20 });
    expect(fittingRange(map, "uncertainty")).toEqual({ low: 0, high: 0.4 });
  });

  it("does not exist without values, and is not empty for a flat sea floor", () => {
    expect(fittingRange(mapOf([[null]], [[false]]), "depth")).toBeNull();
    const flat = fittingRange(mapOf([[7, 7]], [[true, true]]), "depth");
    expect(flat?.high).toBeGreaterThan(flat?.low ?? Number.NaN);
  });

  it.each([
    [0.1, 0.30001],
    [-3.2, 8],
    [1999, 2001],
    [5, 5.0001],
  ])("rounds %f to %f outwards", (low, high) => {
    const [from, to] = roundRange(low, high);
    expect(from).toBeLessThanOrEqual(low);
    expect(to).toBeGreaterThanOrEqual(high);
  });
});

it("colours get darker with depth", () => {
  const light = (value: number) => colourAt(DEEP, value, 0, 1).reduce((a, b) => a + b);
  const steps = Array.from({ length: 21 }, (_, i) => light(i / 20));
  for (let i = 1; i < steps.length; i++) expect(steps[i]).toBeLessThan(steps[i - 1] as number);
});

describe("hatching", () => {
  it.each([
    [1, 1],
    [7, 9],
    [30, 40],
  ])("covers each interpolated cell of a %i x %i grid once and nothing else", (rows, cols) => {
    const map = noisy(rows, cols);
    const covered = Array.from({ length: rows }, () => new Array<number>(cols).fill(0));
    for (const { west, south, east, north } of interpolatedBlocks(map)) {
      for (let r = south; r < north; r++)
        for (let c = west; c < east; c++) (covered[r] as number[])[c] = (covered[r]?.[c] ?? 0) + 1;
    }
    const wanted = map.depth_m.map((row, r) =>
      row.map((value, c) => Number(value !== null && !map.sounded[r]?.[c])),
    );
    expect(covered).toEqual(wanted);
  });

  it("merges a plain area into one block", () => {
    const map = mapOf(
      [
        [1, 1],
        [1, 1],
        [1, 1],
      ],
      [
        [false, false],
        [false, false],
        [false, false],
      ],
    );
    expect(interpolatedBlocks(map)).toEqual([{ west: 0, south: 0, east: 2, north: 3 }]);
  });
});
