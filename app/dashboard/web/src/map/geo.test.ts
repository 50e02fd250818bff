import { describe, expect, it } from "vitest";
import type { LngLat } from "../api/types";
import { boundsOf, graticule, graticuleStep, metresPerDegree, rectangle, widened } from "./geo";

describe("metres per degree", () => {
  it.each([
    [0, 110_574.3, 111_319.5],
    [45, 111_131.8, 78_846.8],
    [-60, 111_412.2, 55_800],
  ])("at latitude %f agrees with the published lengths of a degree", (latitude, north, east) => {
    const scale = metresPerDegree(latitude);
    expect(scale.north).toBeCloseTo(north, 0);
    expect(scale.east).toBeCloseTo(east, 0);
  });
});

describe("a rectangle from a corner and a size", () => {
  const ring = rectangle([-8.705, 41.185], 100, 50).coordinates[0] as LngLat[];

  it("is a closed ring with the corner in its south-west", () => {
    expect(ring).toHaveLength(5);
    expect(ring[0]).toEqual(ring[4]);
    expect(boundsOf(ring)?.slice(0, 2)).toEqual([-8.705, 41.185]);
  });

  it("has the size asked for", () => {
    const scale = metresPerDegree(41.185);
    const [west, south, east, north] = boundsOf(ring) as [number, number, number, number];
    expect((east - west) * scale.east).toBeCloseTo(100, 2);
    expect((north - south) * scale.north).toBeCloseTo(50, 2);
  });
});

describe("the graticule", () => {
  it.each([0.0001, 0.0123, 1, 50])(
    "has a few lines across %f degrees, at whole multiples of its step",
    (width) => {
      const bounds = [10.00001, 50, 10.00001 + width, 50 + width / 2] as [number, number, number, number];
      const step = graticuleStep(bounds);
      const { meridians, decimals } = graticule(bounds, step);
      expect(meridians.length).toBeGreaterThanOrEqual(2);
      expect(meridians.length).toBeLessThanOrEqual(7);
      for (const lng of meridians) expect(lng / step).toBeCloseTo(Math.round(lng / step), 5);
      const labels = meridians.map((lng) => lng.toFixed(decimals));
      expect(new Set(labels).size).toBe(labels.length);
    },
  );
});

it("bounds are widened by places near them only", () => {
  expect(widened([0, 0, 1, 1], [[1.5, -0.5]])).toEqual([0, -0.5, 1.5, 1]);
  expect(widened([0, 0, 1, 1], [[3, 0]])).toEqual([0, 0, 1, 1]);
});
