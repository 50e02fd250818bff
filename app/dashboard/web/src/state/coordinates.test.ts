import { expect, it } from "vitest";
import { placeOf, typedPlace } from "./coordinates";

it.each([
  ["41.1852, -8.7046", 1e-12],
  ["41.1852 -8.7046", 1e-12],
  ["41,1852; -8,7046", 1e-12],
  ["41.1852° N 8.7046° W", 1e-9],
  ["41°11.112′ N 008°42.276′ W", 1e-9],
  ["N41 11.112 W008 42.276", 1e-9],
  ["41-11.112N 008-42.276W", 1e-9],
  ["41°11'06.7\"N 8°42'16.6\"W", 2e-5],
])("%s is a place", (text, off) => {
  const [lng, lat] = placeOf(text) ?? [0, 0];
  expect(Math.abs(lat - 41.1852)).toBeLessThanOrEqual(off);
  expect(Math.abs(lng + 8.7046)).toBeLessThanOrEqual(off);
});

it("whole degrees, the equator and what was typed before are places, too", () => {
  expect(placeOf("-33.9 18.4")).toEqual([18.4, -33.9]);
  expect(placeOf("0, 0")).toEqual([0, 0]);
  expect(placeOf(typedPlace([-8.7046, 41.1852]))).toEqual([-8.7046, 41.1852]);
});

it.each(["", "quay", "41.1852", "91, 3", "12, 181", "41.1852, "])("%j is none", (text) => {
  expect(placeOf(text)).toBeNull();
});
