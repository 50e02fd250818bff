import { expect, test } from "vitest";
import type { LngLat, TargetView } from "../../api/types";
import { wayBetween } from "../geo";
import { ellipseRing, targetMarks } from "./targets";

const AT: LngLat = [-8.7, 41.18];

test("an ellipse reaches as far as its axes, the longer one in its direction", () => {
  const ring = ellipseRing(AT, { semi_major_m: 30, semi_minor_m: 5, orientation_deg: 60 });
  const ways = ring.map((place) => wayBetween(AT, place));
  const farthest = ways.reduce((a, b) => (b.metres > a.metres ? b : a));
  expect(farthest.metres).toBeCloseTo(30, 1);
  expect(farthest.bearing_deg % 180).toBeCloseTo(60, 0);
  expect(Math.min(...ways.map((way) => way.metres))).toBeCloseTo(5, 1);
  expect(ring.at(-1)?.[0]).toBeCloseTo(ring[0]?.[0] ?? 0, 9);
});

test("a target that was never heard is nowhere, one without an ellipse is a point", () => {
  const heard = { name: "tag", accurate: false, lon_deg: AT[0], lat_deg: AT[1], ellipse: null } as TargetView;
  expect(targetMarks([{ ...heard, lon_deg: null, lat_deg: null }])).toEqual([]);
  expect(targetMarks([heard])).toEqual([{ name: "tag", accurate: false, at: AT, ring: [] }]);
});
