import { describe, expect, it } from "vitest";
import type { VehicleView, WaypointView } from "../api/types";
import { age, clock, count, distance, duration, latitude, longitude, metres } from "./format";
import { batteryWords, flownWords, hasEnded, isAllowed, lengthWords, vehicleState } from "./words";

describe("numbers", () => {
  it.each([
    [0, "0 s"],
    [59.6, "1 min 00 s"],
    [187, "3 min 07 s"],
    [7500, "2 h 05 min"],
    [null, "–"],
    [-3, "0 s"],
  ])("%s seconds last %s", (seconds, words) => {
    expect(duration(seconds)).toBe(words);
  });

  it("are written with their units", () => {
    expect(metres(2.345, 2)).toBe("2.35 m");
    expect(metres(undefined)).toBe("–");
    expect(distance(980)).toBe("980 m");
    expect(distance(1234)).toBe("1.23 km");
    expect(count(1_234_567)).toBe("1 234 567");
    expect(age(2.34)).toBe("2.3 s");
    expect(age(null)).toBe("never");
  });

  it("name the hemisphere instead of a sign", () => {
    expect(latitude(-33.5, 1)).toBe("33.5° S");
    expect(longitude(8.70512, 4)).toBe("8.7051° E");
  });

  it("tell UTC", () => {
    expect(clock(new Date("2026-03-01T05:06:07Z"), "utc")).toBe("05:06:07");
  });
});

describe("how far a mission has come", () => {
  const known = { step: 12, steps: 60, minutes_left: null, km_left_per_vehicle: null };
  it.each([
    [{ minutes: 60 }, { minutes_left: 48.2 }, "12 of 60 min"],
    [{ minutes: 7.5 }, { minutes_left: 8 }, "0.0 of 7.5 min"],
    [{ km_per_vehicle: 2.3 }, { km_left_per_vehicle: 1.1 }, "1.2 of 2.3 km"],
    [{ minutes: 60 }, {}, "step 12 of 60"],
    [{ steps: 60 }, { minutes_left: 48 }, "step 12 of 60"],
    [null, {}, "step 12 of 60"],
  ] as const)("is told of %j in its unit", (given, left, words) => {
    const budget = given as Parameters<typeof lengthWords>[0]["budget"];
    expect(lengthWords({ ...known, ...left, budget })).toBe(words);
    expect(flownWords({ ...known, ...left, budget })).toBe(words.startsWith("step") ? null : words);
  });
});

describe("a vehicle's state in words", () => {
  const vehicle = (link: VehicleView["link"], active = true) => ({ link, active }) as VehicleView;
  it("is loudest about a vehicle that is where it must not be", () => {
    const inside = { ...vehicle("engaged"), breach: "in keep-out zone 1" } as VehicleView;
    expect(vehicleState(inside, undefined)).toEqual({ words: "In keep-out zone 1", tone: "alarm" });
  });

  const waypoint = (status: WaypointView["status"]) => ({ step: 7, status }) as WaypointView;

  it("is loud about unexpected silence and calm about silence by plan", () => {
    expect(vehicleState(vehicle("lost"), undefined).tone).toBe("alarm");
    expect(vehicleState(vehicle("expected_offline"), undefined).tone).toBe("calm");
  });

  it("does not claim a route before the vehicle acknowledged it", () => {
    expect(vehicleState(vehicle("engaged"), waypoint("sent")).words).toContain("not acknowledged");
    expect(vehicleState(vehicle("engaged"), waypoint("acknowledged")).words).toBe("To waypoint 7");
    expect(vehicleState(vehicle("engaged"), waypoint("refused")).tone).toBe("alarm");
  });

  it("prefers the link's trouble to the waypoint's state", () => {
    expect(vehicleState(vehicle("lost"), waypoint("acknowledged")).words).toBe("No contact");
    expect(vehicleState(vehicle("lost", false), undefined).words).toBe("Left the mission");
  });
});

describe("commands", () => {
  it("are those that the service allows; a mission of which nothing can be asked is over", () => {
    expect(isAllowed("abort", { allowed_actions: ["abort", "finish"] })).toBe(true);
    expect(isAllowed("start", { allowed_actions: ["abort", "finish"] })).toBe(false);
    expect(hasEnded({ allowed_actions: ["abort"] })).toBe(false);
    expect(hasEnded({ allowed_actions: [] })).toBe(true);
  });
});

it.each([
  ["ok", 80, "80 %"],
  ["low", 30, "▲ 30 %"],
  ["critical", 10, "✕ 10 %"],
  [null, null, "–"],
] as const)("a battery that the service calls %s is written as %s", (battery, battery_pct, words) => {
  expect(batteryWords({ battery, battery_pct } as VehicleView)).toBe(words);
});
