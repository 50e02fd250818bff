import { describe, expect, it } from "vitest";
import type { MissionView, VehicleView, WaypointView } from "../api/types";
import { chosenLanguage } from "../words/say";
import { age, clock, count, distance, duration, latitude, longitude, metres } from "./format";
import {
  batteryWords,
  canReturn,
  failsafeWords,
  flownWords,
  hasEnded,
  isAllowed,
  isSaid,
  lengthWords,
  measuredWords,
  missionWords,
  rangeWords,
  remaining_s,
  sonarWords,
  vehicleState,
  whenLastHeard,
} from "./stateNames";

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

  it.each([
    [80, "1 min 20 s of its time left"],
    [-511, "8 min 31 s beyond its time"],
  ])("is told of a search with %d s left by its time", (left_s, words) => {
    const budget = { minutes: null, km_per_vehicle: null, steps: 60 };
    expect(lengthWords({ ...known, budget, search: { left_s } })).toBe(words);
  });
});

const surveying = {
  active: true,
  link: "engaged",
  phase: "survey",
  withdrawn: "",
  part_done: false,
  recovery_point: null,
  failsafes: [],
} as unknown as VehicleView;

describe("a vehicle's state in words", () => {
  const vehicle = (link: VehicleView["link"], active = true) =>
    ({ ...surveying, link, active }) as VehicleView;
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

  it("says of a silent service what was heard last, whose good news may hold no more", () => {
    const told = vehicleState(vehicle("engaged"), waypoint("acknowledged"));
    expect(told.tone).toBe("good");
    expect(whenLastHeard(told)).toEqual({ words: "To waypoint 7 when last heard", tone: "calm" });
    expect(whenLastHeard(vehicleState(vehicle("lost"), undefined)).tone).toBe("alarm");
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

describe("a vehicle that surveys no more", () => {
  const away = { ...surveying, withdrawn: "called home by Ana" };
  const low = { failsafe: "low_energy", response: "return", message: "enough for the way home" } as const;

  it.each([
    ["returning", "Returning home"],
    ["surfacing", "Surfacing"],
    ["home", "Home"],
    ["stopped", "Stopped"],
  ] as const)("is %s: %s", (phase, words) => {
    expect(vehicleState({ ...away, phase }, undefined)).toEqual({ words, tone: "good" });
  });

  it("is loud about what is wrong with it, and less so where it was only warned", () => {
    expect(vehicleState({ ...away, phase: "returning", failsafes: [low] }, undefined).tone).toBe("alarm");
    const warned = { ...surveying, failsafes: [{ ...low, response: "warn" as const }] };
    expect(vehicleState(warned, undefined).tone).toBe("warning");
    expect(failsafeWords(low)).toBe("Low energy");
    expect(vehicleState({ ...away, phase: "home", failsafes: [low] }, undefined).tone).toBe("warning");
  });

  it("does not say twice what only differs in its figures", () => {
    const failsafes = [{ ...low, message: "its energy lasts 81 s" }];
    expect(isSaid("its energy lasts 122.5 s", { failsafes })).toBe(true);
    expect(isSaid("called home by Ana", { failsafes })).toBe(false);
  });

  it("is brought home with its mission as long as it is not there", () => {
    const mission = { state: "running", ending: null } as const;
    const homing = { ...surveying, recovery_point: [-8.7, 41.2] as [number, number] };
    expect(canReturn(mission, [surveying, homing])).toBe(true);
    expect(canReturn({ state: "ready", ending: null }, [homing])).toBe(false);
    expect(canReturn({ ...mission, ending: "finished" }, [homing])).toBe(false);
    expect(canReturn(mission, [{ ...homing, withdrawn: "called home", phase: "home" }])).toBe(false);
    const hold = { ...low, response: "hold" as const };
    expect(canReturn(mission, [{ ...homing, withdrawn: "held", phase: "stopped", failsafes: [hold] }])).toBe(
      true,
    );
  });
});

describe("how far a vehicle still goes", () => {
  const now = Date.parse("2026-03-01T12:00:00Z");

  it("is told in minutes, with when it has to turn back", () => {
    const range = {
      ...surveying,
      energy_left_s: 2500,
      turn_back_at: "2026-03-01T12:31:30Z",
      return_needs_s: 40,
    };
    expect(rangeWords(range, now)).toEqual([
      "41 min left",
      "way home takes < 1 min",
      "turn back at 12:31 UTC (in 31 min)",
    ]);
    expect(rangeWords({ ...range, turn_back_at: "2026-03-01T11:59:59Z" }, now)[2]).toContain("(now)");
  });

  it("is left out where it is not known", () => {
    expect(
      rangeWords({ ...surveying, energy_left_s: null, turn_back_at: null, return_needs_s: null }, now),
    ).toEqual([]);
  });
});

it("a mission that is ending says what it becomes", () => {
  expect(missionWords({ state: "running", ending: "aborted" })).toBe("Returning home; then aborted");
  expect(missionWords({ state: "running", ending: null })).toBe("Running");
});

describe("swath sonars", () => {
  it("are described with what the service takes where nothing is said", () => {
    const carrier = { name: "a", sensor: "multibeam" } as VehicleView;
    const described = [{ name: "a", sonar: { aperture_deg: 90, beams: 128, rate_hz: 5, range_m: 40 } }];
    const spec = described as unknown as MissionView["spec"]["vehicles"];
    expect(sonarWords(carrier, spec)).toEqual(["multibeam 90°", "128 beams", "5 Hz", "reaches 40 m"]);
    expect(sonarWords({ ...carrier, name: "b" }, spec)[0]).toBe("multibeam 120°");
    expect(sonarWords({ ...carrier, sensor: "dvl" }, spec)).toEqual([]);
  });

  it("count beams, not soundings", () => {
    expect(measuredWords({ soundings: 12, beams: 0 })).toBe("12 soundings");
    expect(measuredWords({ soundings: 0, beams: 1200 })).toContain("beams");
    expect(measuredWords({ soundings: 3, beams: 9 })).toBe("3 soundings, 9 beams");
  });
});

it("a mission whose vehicles are on their way home lasts until the last is there", () => {
  const coming = (phase: "returning" | "home", return_needs_s: number | null) => ({
    active: true,
    phase,
    return_needs_s,
  });
  expect(remaining_s(90, [coming("returning", 200)])).toBe(90);
  expect(remaining_s(0, [coming("returning", 200), coming("home", 300), coming("returning", null)])).toBe(
    200,
  );
  expect(remaining_s(0, [])).toBe(0);
  expect(remaining_s(null, [coming("returning", 200)])).toBeNull();
});

it("a length that is no whole number is told with the language's comma in both figures", () => {
  chosenLanguage.value = "pt";
  const km = {
    km_left_per_vehicle: 1.2,
    minutes_left: null,
    budget: { km_per_vehicle: 1.5 },
    step: 3,
    steps: 9,
  };
  expect(flownWords(km as Parameters<typeof flownWords>[0])).toBe("0,3 de 1,5 km");
  chosenLanguage.value = "system";
});
