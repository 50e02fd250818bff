import { describe, expect, it } from "vitest";
import type { Pixel } from "../canvas/polylines";
import { frameRing, within } from "./lasso";

const SQUARE: Pixel[] = [
  [0, 0],
  [10, 0],
  [10, 10],
  [0, 10],
];

describe("a lasso", () => {
  it("catches the points within it, none behind the camera, and none of what it winds round", () => {
    const points = new Float32Array([5, 5, 15, 5, Number.NaN, Number.NaN, 9, 1, -1, 5]);
    expect(within(points, SQUARE)).toEqual([0, 3]);
    const horseshoe: Pixel[] = [
      [0, 0],
      [10, 0],
      [10, 10],
      [7, 10],
      [7, 3],
      [3, 3],
      [3, 10],
      [0, 10],
    ];
    expect(within(new Float32Array([5, 8, 1, 8, 9, 8]), horseshoe)).toEqual([1, 2]);
  });

  it("that is no more than a line catches nothing", () => {
    expect(
      within(new Float32Array([1, 1]), [
        [0, 0],
        [2, 2],
      ]),
    ).toEqual([]);
  });

  it("of the keyboard is round", () => {
    const ring = frameRing({ x: 50, y: 40, radius: 20 });
    expect(within(new Float32Array([50, 40, 69, 40, 64, 54, 65, 55]), ring)).toEqual([0, 1, 2]);
  });

  it("goes through a hundred thousand points at once", () => {
    const points = new Float32Array(200_000).map((_, i) => (i * 7919) % 1000);
    const found = within(points, frameRing({ x: 500, y: 500, radius: 300 }));
    const away = (i: number) =>
      Math.hypot((points[2 * i] as number) - 500, (points[2 * i + 1] as number) - 500);
    const near = [...Array(100_000).keys()].filter((i) => away(i) < 295);
    const caught = new Set(found);
    expect(near.length).toBeGreaterThan(0);
    expect(near.every((i) => caught.has(i))).toBe(true);
    expect(found.every((i) => away(i) <= 300)).toBe(true);
  });
});
