import { describe, expect, it } from "vitest";
import type { TelemetryView } from "../../api/types";
import type { Sample } from "../live";
import { figuresOver } from "./telemetry";

const heard = (at: number, depth_m: number | null): Sample => ({
  at,
  depth_m,
  altitude_m: null,
  battery_pct: null,
  age_s: 0,
});

const kept: TelemetryView = {
  times_s: [100, 105, 110, 115],
  vehicles: [
    {
      vehicle: "a",
      depth_m: [1, 2, 3, 4],
      altitude_m: [9, 8, 7, 6],
      battery_pct: [80, 79, 78, 77],
      age_s: [0, 0, 1, 0],
    },
    {
      vehicle: "gone",
      depth_m: [5, null, null, null],
      altitude_m: [5, null, null, null],
      battery_pct: [50, null, null, null],
      age_s: [0, 40, 45, 50],
    },
  ],
};

describe("figures over time", () => {
  it("reach back to before the page was opened, and go on with what it heard", () => {
    const { times_s, vehicles } = figuresOver("depth_m", kept, {
      a: [heard(114_000, 3.5), heard(115_000, 3.7), heard(116_000, 3.8)],
    });
    expect(times_s).toEqual([100, 105, 110, 114, 115, 116]);
    expect(vehicles).toEqual([
      { name: "a", values: [1, 2, 3, 3.5, 3.7, 3.8] },
      { name: "gone", values: [5, null, null, null, null, null] },
    ]);
  });

  it("fill the time in which the page slept", () => {
    const { times_s, vehicles } = figuresOver("depth_m", kept, {
      a: [heard(101_000, 1.1), heard(114_000, 3.9)],
    });
    expect(times_s).toEqual([101, 105, 110, 114]);
    expect(vehicles[0]?.values).toEqual([1.1, 2, 3, 3.9]);
  });

  it("are all from the service when the mission has ended", () => {
    const { times_s, vehicles } = figuresOver("battery_pct", kept, {});
    expect(times_s).toEqual([100, 105, 110, 115]);
    expect(vehicles[0]?.values).toEqual([80, 79, 78, 77]);
  });

  it("have gaps where a vehicle joined later, and begin with nothing", () => {
    const { vehicles } = figuresOver("depth_m", null, {
      a: [heard(1000, 1), heard(2000, 2)],
      late: [heard(2000, 7)],
    });
    expect(vehicles[1]).toEqual({ name: "late", values: [null, 7] });
    expect(figuresOver("depth_m", null, {})).toEqual({ times_s: [], vehicles: [] });
  });
});
