import { expect, test } from "vitest";
import { wayBetween } from "../geo";
import { aboutCrossing, barsOf, outliersOf } from "./crossings";

test("what is shown of a crossing is 50 m wide and high with it in the middle", () => {
  const [west, south, east, north] = aboutCrossing({ lon_deg: -8.7, lat_deg: 41.18 });
  expect([(west + east) / 2, (south + north) / 2]).toEqual([
    expect.closeTo(-8.7, 9) as number,
    expect.closeTo(41.18, 9) as number,
  ]);
  expect(wayBetween([west, 41.18], [east, 41.18]).metres).toBeCloseTo(50, 1);
  expect(wayBetween([-8.7, south], [-8.7, north]).metres).toBeCloseTo(50, 1);
});

test("only crossings that disagree are drawn", () => {
  const crossing = { number: 1, outlier: true };
  const features = [crossing, { number: 2, outlier: false }].map((properties) => ({ properties }));
  const answer = { features: { features } } as Parameters<typeof outliersOf>[0];
  expect(outliersOf(answer)).toEqual([crossing]);
});

test("the highest bar is as high as the picture", () => {
  expect(barsOf([0, 2, 4], 30, 20)).toEqual([
    { x: 0, y: 20, width: 10, height: 0 },
    { x: 10, y: 10, width: 10, height: 10 },
    { x: 20, y: 0, width: 10, height: 20 },
  ]);
  expect(barsOf([], 30, 20)).toEqual([]);
});
