import { describe, expect, it } from "vitest";
import type { LngLat } from "../../api/types";
import { wayBetween } from "../geo";
import { cutAt } from "./plan";

const WAY: LngLat[] = [
  [-8.705, 41.185],
  [-8.704, 41.185],
  [-8.704, 41.186],
];

const length = (way: readonly LngLat[]) =>
  way.slice(1).reduce((sum, place, i) => sum + wayBetween(way[i] as LngLat, place).metres, 0);

describe("a way", () => {
  it("is cut where its vehicle has to turn back", () => {
    const [before, beyond] = cutAt(WAY, 100);
    expect(length(before)).toBeCloseTo(100, 1);
    expect(length(before) + length(beyond)).toBeCloseTo(length(WAY), 1);
    expect(before.at(-1)).toEqual(beyond[0]);
  });

  it("is whole where nothing makes it turn, or only at its end", () => {
    expect(cutAt(WAY, null)).toEqual([WAY, []]);
    expect(cutAt(WAY, 1e6)).toEqual([WAY, []]);
    expect(cutAt([], 0)).toEqual([[], []]);
  });
});
