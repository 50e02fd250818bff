import { describe, expect, it } from "vitest";
import type { LngLat, StepView, WaypointView } from "../../api/types";
import { place } from "../format";
import { endsOf, figuresOf, lastFlown, placeAt, withSteps } from "./history";

const waypoint = (step: number, lng: number, status: WaypointView["status"] = "reached") =>
  ({ vehicle: "a", step, lon_deg: lng, lat_deg: 0, depth_m: 2, arrival_radius_m: 3, status }) as WaypointView;

const stepOf = (number: number, lng: number, status?: WaypointView["status"]): StepView => ({
  number,
  committed_at: "2026-11-21T12:00:00Z",
  objective: number === 2 ? null : 1 / number,
  terms: number > 1 ? { feasible: number } : {},
  figures: { coverage_pct: 10 * number },
  soundings: 5 * number,
  waypoints: [waypoint(number, lng, status)],
});

const way = {
  places: Array.from({ length: 41 }, (_, i): LngLat => [i * 1e-5, 0]),
  depths_m: Array.from({ length: 41 }, () => 2),
};

describe("where a vehicle was at a step", () => {
  it("is the end of its way to the waypoints that it reached", () => {
    const steps = [stepOf(1, 10e-5), stepOf(2, 30e-5)];
    const ends = endsOf("a", way, steps);
    expect(ends[0]).toBeGreaterThanOrEqual(8);
    expect(ends[0]).toBeLessThanOrEqual(12);
    expect(ends[1]).toBeGreaterThanOrEqual(28);
    expect(placeAt("a", way, ends, 1, steps[1] as StepView)?.place[0]).toBeCloseTo(30e-5, 4);
  });

  it("stays where it was when a waypoint was missed", () => {
    const ends = endsOf("a", way, [stepOf(1, 10e-5), stepOf(2, 35e-5, "missed")]);
    expect(ends[1]).toBe(ends[0]);
  });

  it("is where it was sent when its way is not known, and nowhere for a stranger", () => {
    expect(placeAt("a", undefined, [], 0, stepOf(1, 10e-5))?.place).toEqual([10e-5, 0]);
    expect(placeAt("b", undefined, [], 0, stepOf(1, 10e-5))).toBeNull();
  });
});

describe("steps that are told again", () => {
  const known = [stepOf(1, 0), stepOf(2, 0, "acknowledged"), stepOf(3, 0, "planned")];

  it("are those from the first one on that was still to be flown", () => {
    expect(lastFlown(known)).toBe(1);
    expect(lastFlown([stepOf(1, 0), stepOf(2, 0, "missed")])).toBe(2);
    expect(lastFlown([stepOf(1, 0, "sent")])).toBe(0);
    expect(lastFlown([])).toBe(0);
  });

  it("take the places of what was known of them", () => {
    const steps = withSteps(known, [stepOf(2, 0), stepOf(3, 0, "missed"), stepOf(4, 0, "planned")]);
    expect(steps.map(({ number, waypoints }) => [number, waypoints[0]?.status])).toEqual([
      [1, "reached"],
      [2, "reached"],
      [3, "missed"],
      [4, "planned"],
    ]);
  });
});

it("figures over the steps have gaps where a step has none", () => {
  const figures = figuresOf([stepOf(1, 0), stepOf(2, 0)]);
  expect(figures.coverage).toEqual([10, 20]);
  expect(figures.deviation).toEqual([null, null]);
  expect(figures.objective).toEqual([1, null]);
  expect(figures.terms).toEqual([{ label: "choices that break no limit", values: [null, 2] }]);
});

describe("positions are written", () => {
  it("in degrees and decimal minutes as on charts", () => {
    expect(place([-8.705, 41.185], "minutes")).toBe("41°11.1000′ N 008°42.3000′ W");
    expect(place([0.99999999, -0.5], "minutes")).toBe("00°30.0000′ S 001°00.0000′ E");
  });

  it("in decimal degrees", () => {
    expect(place([-8.705, 41.185], "decimal")).toBe("41.185000° N 8.705000° W");
  });
});
