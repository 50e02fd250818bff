import { expect, it } from "vitest";
import type { LngLat } from "../../api/types";
import { ringOf } from "../../map/area";
import { rectangle } from "../../map/geo";
import { type Draft, emptyDraft } from "./draft";
import { asTyped, withRings } from "./places";

const drawn = (ring: LngLat[]): Draft => ({ ...emptyDraft([10, 60]), source: "drawn", ring });

it("a rectangle that is typed instead is where the drawn area is and as large", () => {
  const ring = ringOf(rectangle([-8.705, 41.185], 250, 150));
  const typed = {
    source: "typed",
    latitude: "41.1850000",
    longitude: "-8.7050000",
    east_m: "250",
    north_m: "150",
  };
  expect(asTyped(drawn(ring))).toEqual(typed);
  const [a, b, c] = ring as [LngLat, LngLat, LngLat];
  expect(asTyped(drawn([a, b, c]))).toEqual(typed);
  expect(asTyped(drawn([]))).toEqual({ source: "typed" });
});

it("rings that are there already do not come twice", () => {
  const [one, other] = [ringOf(rectangle([0, 0], 9, 9)), ringOf(rectangle([1, 0], 9, 9))];
  expect(withRings([one], [[...one], other])).toEqual([one, other]);
});
