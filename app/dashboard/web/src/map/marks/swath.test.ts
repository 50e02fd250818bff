import { expect, test } from "vitest";
import type { LngLat } from "../../api/types";
import { wayBetween } from "../geo";
import { aboutHoliday, swathEnds, swathOpacity } from "./swath";

const AT: LngLat = [-8.7, 41.18];

test("a swath lies across the heading, port to its left", () => {
  const [port, starboard] = swathEnds(AT, 90, [12, 20]);
  expect(wayBetween(AT, port)).toMatchObject({
    metres: expect.closeTo(12, 2) as number,
    bearing_deg: expect.closeTo(0, 1) as number,
  });
  expect(wayBetween(AT, starboard)).toMatchObject({
    metres: expect.closeTo(20, 2) as number,
    bearing_deg: expect.closeTo(180, 1) as number,
  });
});

test("a swath fades", () => {
  expect([0, 2, 6, 10, 60].map(swathOpacity)).toEqual([1, 1, 0.5, 0, 0]);
});

test("what is shown of a holiday is three times as wide and high", () => {
  const ring: LngLat[] = [
    [1, 2],
    [2, 2],
    [2, 4],
    [1, 4],
    [1, 2],
  ];
  const holiday = {
    properties: { number: 1, area_m2: 2, lat_deg: 3, lon_deg: 1.5 },
    geometry: { coordinates: [[ring]] },
  };
  expect(aboutHoliday(holiday)).toEqual([0, 0, 3, 6]);
});
