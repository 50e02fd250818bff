import { describe, expect, it } from "vitest";
import type { ProfileView } from "../../api/types";
import {
  type Cut,
  csvOf,
  depthsOf,
  differenceAlong,
  lineText,
  lineTyped,
  nearestIndex,
  piecesOf,
  ticksOf,
  typedLine,
} from "./profile";

const profile = (changes: Partial<ProfileView> = {}): ProfileView => ({
  mission_id: "a",
  name: "Quay",
  version: 1,
  step: 3,
  vertical_datum: "chart datum",
  length_m: 5,
  spacing_m: 1,
  positions: [0, 1, 2, 3, 4, 5].map((i) => [-8.7 + i / 1e4, 41.1]),
  along_m: [0, 1, 2, 3, 4, 5],
  depth_m: [10, 10.5, 11, null, 12, 12.5],
  sd_m: [0.1, 0.1, 0.4, null, 0.3, 2],
  sounded: [true, true, false, false, false, false],
  layers: {},
  within_m: 1,
  soundings: [{ along_m: 1.2, across_m: -0.4, depth_m: 9.8, sd_m: 0.08 }],
  soundings_found: 1,
  ...changes,
});
const cut = (changes: Partial<ProfileView> = {}): Cut => ({
  id: "a",
  name: "Quay",
  colour: "#000000",
  profile: profile(changes),
});

describe("a profile", () => {
  it("is drawn in pieces: measured, guessed, and nothing where nothing is known or anything could be", () => {
    const pieces = piecesOf(profile(), 1);
    expect(pieces.map(({ sounded, points }) => [sounded, points.map((p) => p.along_m)])).toEqual([
      [true, [0, 1]],
      [false, [1, 2]],
      [false, [4]],
    ]);
  });

  it("has room for its deviations and soundings", () => {
    const found = depthsOf([cut()], 1);
    expect(found?.low).toBeLessThan(9.8);
    expect(found?.high).toBeGreaterThan(12.6);
    expect(depthsOf([cut({ depth_m: [null, null, null, null, null, null], soundings: [] })], 1)).toBeNull();
  });

  it("is compared where both surveys know the bottom", () => {
    const later = profile({ depth_m: [10.5, 10.5, null, 11, 12, 12] });
    expect(differenceAlong(profile(), later)).toEqual([0.5, 0, null, null, 0, -0.5]);
  });

  it("is found again from a way along it", () => {
    expect([-1, 0.4, 2.6, 9].map((m) => nearestIndex(profile().along_m, m))).toEqual([0, 0, 3, 5]);
  });
});

it.each([
  [0, 10, 5, [0, 2, 4, 6, 8, 10]],
  [9.83, 10.27, 5, [9.9, 10, 10.1, 10.2]],
  [-3, 120, 4, [0, 50, 100]],
])("an axis from %d to %d has round ticks", (low, high, most, ticks) => {
  expect(ticksOf(low, high, most)).toEqual(ticks);
});

describe("the table of a profile", () => {
  it("has every point and sounding, with nothing for what is not known", () => {
    const rows = csvOf([cut({ layers: { slope: [1, 2, 3, null, 5, 6] } })])
      .trim()
      .split("\r\n");
    expect(rows).toHaveLength(8);
    expect(rows[0]).toMatch(/^mission,kind,along_m,.*,state,slope$/);
    expect(rows[1]).toBe("Quay,map,0,0,-8.7,41.1,10,0.1,sounded,1");
    expect(rows[4]).toMatch(/,,,unknown,$/);
    expect(rows[7]).toBe("Quay,sounding,1.2,-0.4,,,9.8,0.08,sounded,");
  });

  it("keeps names from being read as something else", () => {
    const [, row] = csvOf([cut({ name: '=1+1,"x"' })]).split("\r\n");
    expect(row).toMatch(/^"'=1\+1,""x""",map,/);
  });
});

describe("a line", () => {
  it("is typed as places and asked for as the service takes it", () => {
    const line = typedLine("41.1851, -8.7049; 41.1856, -8.7041");
    expect(line).toEqual([
      [-8.7049, 41.1851],
      [-8.7041, 41.1856],
    ]);
    expect(lineText(line ?? [])).toBe("-8.7049000,41.1851000;-8.7041000,41.1856000");
    expect(typedLine(lineTyped(line ?? []))).toEqual(line);
  });

  it.each(["", "41.1851, -8.7049", "41.1851, -8.7049; nowhere"])("is none in %j", (text) => {
    expect(typedLine(text)).toBeNull();
  });
});
