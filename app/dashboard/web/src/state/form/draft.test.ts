import { describe, expect, it } from "vitest";
import type { MissionView, NewMission } from "../../api/types";
import { boundsOf } from "../../map/geo";
import {
  areaOf,
  canPlan,
  centred,
  copyOf,
  draftFrom,
  emptyDraft,
  estimate,
  faultsOf,
  fieldOf,
  hasDaysWater,
  sensorOf,
  toMission,
  vehicleNames,
  withSensor,
} from "./draft";

const draft = { ...emptyDraft([-8.705, 41.185]), name: "Quay" };

it("an untouched draft only lacks a name", () => {
  expect(Object.keys(faultsOf(emptyDraft([-8.7, 41.2])))).toEqual(["name"]);
});

describe("a wrong value is named with what would be right", () => {
  it.each([
    [{ latitude: "north" }, "latitude", "number"],
    [{ latitude: "91" }, "latitude", "between"],
    [{ east_m: "" }, "east_m", "number"],
    [{ steps: "2.5" }, "steps", "whole"],
    [{ steps: "0" }, "steps", "between"],
    [{ min_depth_m: "40" }, "max_depth_m", "shallowest"],
    [{ simulated: "0" }, "simulated", "at least one"],
    [{ name: "  " }, "name", "name"],
    [{ names: "port side" }, "names", "port side is no vehicle's name"],
    [{ east_m: "50000", north_m: "50000" }, "ring", "million cells of 1 m"],
  ] as const)("%j", (change, field, words) => {
    const faults = faultsOf({ ...draft, ...change });
    expect(Object.keys(faults)).toEqual([field]);
    expect(faults[field]).toContain(words);
  });
});

describe("what the form does not show is neither judged nor sent", () => {
  const search = { kind: "search", goal: "41.1853, -8.7045", entry: "41.1851, -8.7049" } as const;

  it("overlap of swaths without full coverage", () => {
    const lines = { ...draft, planner: "lawnmower", overlap_pct: "200", crosslines_pct: "x" };
    expect(faultsOf(lines)).toEqual({});
    expect(toMission(lines)).not.toHaveProperty("coverage.overlap_pct");
    const swath = { ...lines, planner: "swath", sensor: "multibeam" } as const;
    expect(Object.keys(faultsOf(swath))).toEqual(["overlap_pct", "crosslines_pct"]);
  });

  it("in a search the depth of the bottom, the distance of lines, the planner and other blocks", () => {
    const hidden = { floor_depth_m: "abc", spacing_m: "-1", planner: "swath" };
    const blocks = [{ name: "", ring: [] }];
    expect(faultsOf({ ...draft, ...search, ...hidden, blocks })).toEqual({});
    expect(Object.keys(faultsOf({ ...draft, ...hidden, blocks })).sort()).toEqual([
      "blocks",
      "floor_depth_m",
      "planner",
      "spacing_m",
    ]);
  });

  it("a length that is said by the distance of lines", () => {
    const lines = { ...draft, spacing_m: "10", steps: "x", km_per_vehicle: "y" };
    expect(faultsOf(lines)).toEqual({});
    expect(Object.keys(faultsOf({ ...lines, spacing_m: "wide" }))).toEqual(["spacing_m"]);
  });
});

it("lines that are too close for what a vehicle may fly are told of where their distance is typed", () => {
  const wide = { ...draft, east_m: "3000", north_m: "3000", cell_m: "5", spacing_m: "2" };
  expect(faultsOf(wide)).toEqual({ spacing_m: expect.stringContaining("2250 km for each vehicle") });
  expect(fieldOf("budget.km_per_vehicle", wide)).toBe("spacing_m");
  // So it is in a block that the fields do not describe.
  const small = { ...wide, east_m: "100", north_m: "100" };
  expect(faultsOf(small)).toEqual({});
  const ring = areaOf(wide)?.coordinates[0]?.slice(0, -1) as [number, number][];
  expect(Object.keys(faultsOf({ ...small, blocks: [{ name: "", ring }] }))).toEqual(["spacing_m"]);
});

describe("swath sonars", () => {
  const swath = { ...draft, sensor: "multibeam" as const, planner: "swath" };

  it("are described where they are no usual ones, and are copied", () => {
    const mission = toMission({ ...swath, own: { "sim-2": { aperture_deg: "90", speed_mps: "1.5" } } });
    expect(mission.vehicles).toEqual([
      { name: "sim-1", kind: "sim", sensor: "multibeam" },
      { name: "sim-2", kind: "sim", sensor: "multibeam", speed_mps: 1.5, sonar: { aperture_deg: 90 } },
    ]);
    expect(mission).toMatchObject({ planner: { name: "swath" }, coverage: { overlap_pct: 6 } });
    const copy = copyOf({ name: "Quay", spec: { tide: {}, ...mission } as unknown as MissionView["spec"] });
    expect(toMission(copy).vehicles).toEqual(mission.vehicles);
    expect(
      toMission({ ...copy, own: { "sim-2": { ...copy.own["sim-2"], sensor: "dvl" } } }).vehicles[1],
    ).toEqual({
      name: "sim-2",
      kind: "sim",
      sensor: "dvl",
      speed_mps: 1.5,
    });
  });

  it("are held to the service's bounds", () => {
    expect(faultsOf(swath)).toEqual({});
    expect(faultsOf({ ...swath, own: { "sim-1": { beams: "1" } } })["own.sim-1.beams"]).toContain(
      "Beams of sim-1 must be",
    );
    expect(fieldOf("vehicles.1.sonar.rate_hz", swath)).toBe("own.sim-2.rate_hz");
    expect(fieldOf("coverage.overlap_pct", swath)).toBe("overlap_pct");
  });

  it("are needed on every vehicle for full coverage", () => {
    const one = { ...swath, own: { "sim-1": { sensor: "dvl" as const } } };
    expect(canPlan("swath", swath)).toBe(true);
    expect(canPlan("swath", one)).toBe(false);
    expect(faultsOf(one).planner).toContain("multibeam");
  });
});

it("all simulated vehicles take another sensor, also those of a copy, and no real one does", () => {
  const chosen = [
    { name: "sim-1", kind: "sim", sensor: "dvl" },
    { name: "lauv-1", kind: "imc", sensor: "dvl" },
  ] as const;
  const copy = {
    ...draft,
    chosen,
    simulated: "1",
    own: { "sim-1": { sensor: "dvl" as const, speed_mps: "2" } },
  };
  const made = { ...copy, ...withSensor("multibeam", copy) };
  expect(vehicleNames(made).map((name) => [name, sensorOf(made, name)])).toEqual([
    ["sim-1", "multibeam"],
    ["lauv-1", "dvl"],
    ["sim-2", "multibeam"],
  ]);
  expect(made.own["sim-1"]).toEqual({ speed_mps: "2" });
});

describe("a search", () => {
  const search = { ...draft, kind: "search" as const, goal: "41.1853, -8.7045", entry: "41.1851 -8.7049" };

  it("needs two places, and no steps", () => {
    expect(Object.keys(faultsOf({ ...search, goal: "", entry: "north", steps: "" }))).toEqual([
      "goal",
      "entry",
    ]);
    expect(faultsOf({ ...search, steps: "" })).toEqual({});
  });

  it("is sent with places as [longitude, latitude] and seconds, and leaves its defaults to the service", () => {
    const mission = toMission({ ...search, window_min: "20" });
    expect(mission.search).toMatchObject({
      goal: [-8.7045, 41.1853],
      entry: [-8.7049, 41.1851],
      window_s: 1200,
    });
    expect(mission).not.toHaveProperty("budget");
    expect(mission).not.toHaveProperty("planner");
  });

  it("is told of beside its own fields", () => {
    expect(fieldOf("search.goal.0", search)).toBe("goal");
    expect(fieldOf("search.goal_radius_m", search)).toBe("goal_radius_m");
  });
});

describe("what is sent", () => {
  it("has the numbers as numbers and a closed area", () => {
    const mission = toMission({ ...draft, steps: " 40 ", east_m: "120" });
    expect(mission.budget).toEqual({ steps: 40 });
    expect(mission.area).toEqual(areaOf({ ...draft, east_m: "120" }));
    expect(mission.limits.max_step_m).toBe(10);
  });

  it("has real vehicles first and simulated ones under free names", () => {
    const chosen = [{ name: "sim-1", kind: "imc", sensor: "dvl" }] as const;
    const mission = toMission({ ...draft, chosen, simulated: "2" });
    expect(mission.vehicles.map((v) => [v.name, v.kind])).toEqual([
      ["sim-1", "imc"],
      ["sim-2", "sim"],
      ["sim-3", "sim"],
    ]);
  });
});

it("an area needs its four numbers only", () => {
  expect(areaOf({ ...draft, name: "", steps: "x" })).not.toBeNull();
  expect(areaOf({ ...draft, north_m: "-1" })).toBeNull();
});

it.each([
  ["limits.max_step_m", "max_step_m"],
  ["vehicles", "simulated"],
  ["vehicles.0.kind", "simulated"],
  ["vehicles.0.name", "names"],
  ["area.coordinates.0", "ring"],
  ["budget.steps", "steps"],
  ["vehicles.0.speed_mps", "own.sim-1.speed_mps"],
  ["vehicles.1.recovery_point.0", "own.sim-2.recovery_point"],
  ["recovery.point.0", "recovery"],
  ["recovery.radius_m", "recovery_radius_m"],
  ["tide.level_m", "tide_m"],
  ["planner.name", "planner"],
  ["planner.options.degree", "options.degree"],
  ["sounding_noise", "other.sounding_noise"],
])("the service's field %s is shown at %s", (service, own) => {
  expect(fieldOf(service, draft)).toBe(own);
});

describe("placing an area in the middle", () => {
  it.each([
    [-8.705, 41.185],
    [151.2, -33.9],
  ])("puts its centre at %f, %f", (lng, lat) => {
    const area = areaOf({ ...draft, east_m: "300", ...centred({ ...draft, east_m: "300" }, [lng, lat]) });
    const [west, south, east, north] = boundsOf(area?.coordinates[0] ?? []) ?? [0, 0, 0, 0];
    expect((west + east) / 2).toBeCloseTo(lng, 5);
    expect((south + north) / 2).toBeCloseTo(lat, 5);
  });

  it("leaves a draft without a size alone", () => {
    expect(centred({ ...draft, east_m: "wide" }, [0, 0])).toEqual({});
  });
});

describe("a drawn area", () => {
  const ring = [
    [-8.705, 41.185],
    [-8.704, 41.185],
    [-8.704, 41.186],
  ] as [number, number][];
  const drawn = { ...draft, source: "drawn", ring } as const;

  it("is sent as drawn, with its keep-out zones, and needs no typed numbers", () => {
    const mission = toMission({ ...drawn, latitude: "", keepOut: [ring], com_range_m: "60" });
    expect(mission.area.coordinates[0]).toHaveLength(4);
    expect(mission.keep_out).toHaveLength(1);
    expect(mission.limits.com_range_m).toBe(60);
  });

  it("has its faults named", () => {
    expect(faultsOf({ ...drawn, ring: [] }).ring).toContain("Draw the area");
    expect(faultsOf({ ...drawn, cell_m: "200" }).ring).toContain("less than two cells");
    expect(faultsOf({ ...drawn, keepOut: [ring.slice(0, 2)] }).keepOut).toContain("zone 1");
  });
});

describe("the length of a mission", () => {
  const two = { ...draft, simulated: "2", max_step_m: "10", speed_mps: "1" };

  it("is sent, checked and copied in the unit that was chosen, and in no other", () => {
    const hour = { ...two, length: "minutes", minutes: "60", steps: "x", km_per_vehicle: "" } as const;
    expect(faultsOf(hour)).toEqual({});
    expect(Object.keys(faultsOf({ ...hour, minutes: "0" }))).toEqual(["minutes"]);
    const mission = toMission(hour);
    expect(mission.budget).toEqual({ minutes: 60 });
    const spec = { tide: {}, search: null, ...mission, steps: 360 } as unknown as MissionView["spec"];
    const copy = copyOf({ name: "Quay", spec });
    expect([copy.length, copy.minutes]).toEqual(["minutes", "60"]);
    expect(toMission({ ...copy, length: "km_per_vehicle", km_per_vehicle: "2" }).budget).toEqual({
      km_per_vehicle: 2,
    });
  });

  it.each([
    ["minutes", { minutes: "10" }, { seconds: 600, metres: 1800 }],
    ["km_per_vehicle", { km_per_vehicle: "0.6" }, { seconds: 600, metres: 1200 }],
    ["steps", { steps: "60" }, { seconds: 600, metres: 1200 }],
  ] as const)("in %s is that of the vehicle that takes longest", (length, text, expected) => {
    expect(estimate({ ...two, ...text, length, own: { "sim-1": { speed_mps: "2" } } }, 10_000)).toMatchObject(
      expected,
    );
  });

  it("may be flown by each vehicle at its own speed", () => {
    const chosen = [{ name: "lauv-1", kind: "imc", sensor: "dvl" }] as const;
    const fleet = {
      ...draft,
      chosen,
      simulated: "1",
      own: { "lauv-1": { speed_mps: "0.8" }, gone: { speed_mps: "9" } },
    };
    expect(faultsOf({ ...fleet, own: { "sim-1": { speed_mps: "6" } } })["own.sim-1.speed_mps"]).toContain(
      "Speed of sim-1",
    );
    expect(faultsOf(fleet)).toEqual({});
    const mission = toMission(fleet);
    expect(mission.vehicles.map((vehicle) => vehicle.speed_mps)).toEqual([0.8, undefined]);
    const spec = { tide: {}, search: null, ...mission } as unknown as MissionView["spec"];
    expect(copyOf({ name: "Quay", spec }).own).toEqual({ "lauv-1": { speed_mps: "0.8" }, "sim-1": {} });
  });
});

it("says before the start how long it takes at most and how dense it gets", () => {
  expect(
    estimate({ ...draft, simulated: "2", steps: "100", max_step_m: "10", speed_mps: "1" }, 10_000),
  ).toMatchObject({
    seconds: 1000,
    metres: 2000,
    spacing_m: 5,
  });
  expect(estimate({ ...draft, simulated: "0" }, 10_000)).toBeNull();
});

describe("names of simulated vehicles", () => {
  it("are those that were given", () => {
    const mission = toMission({ ...draft, simulated: "2", names: "north, south" });
    expect(mission.vehicles.map((v) => v.name)).toEqual(["north", "south"]);
  });

  it("are filled up with such as nobody else has, and refused where two are the same", () => {
    const named = (names: string) => ({ ...draft, simulated: "2", names });
    expect(vehicleNames(named("sim-1"))).toEqual(["sim-1", "sim-2"]);
    expect(vehicleNames(named("north, south, west"))).toEqual(["north", "south"]);
    expect(faultsOf(named("north, north")).names).toContain("Two vehicles are called north");
  });
});

it("a copy keeps what the form does not show, and its vehicles as they are described", () => {
  const vehicle = { name: "lauv-1", kind: "imc", sensor: "dvl", guidance: "legs", depth_m: 3 };
  const original = {
    ...toMission({ ...draft, com_range_m: "80" }),
    kind: "survey",
    keep_out: [],
    seed: 7,
    vehicles: [vehicle],
    tide: { level_m: 0, source: "none" },
    search: null,
    steps: 100,
  };
  const limits = { ...original.limits, keep_out_margin_m: 25 };
  const copy = copyOf({ name: "Quay", spec: { ...original, limits } } as unknown as MissionView);
  expect(copy.name).toBe("Quay (copy)");
  const again = toMission({ ...copy, com_range_m: "" }) as unknown as Record<string, unknown>;
  expect(again.vehicles).toEqual([vehicle]);
  expect(again.seed).toBe(7);
  expect(again.budget).toEqual({ steps: 100 });
  expect(again).not.toHaveProperty("steps");
  expect(again.limits).toMatchObject({ keep_out_margin_m: 25, com_range_m: null });
  expect(again.area).toEqual(original.area);
});

describe("casts and water levels", () => {
  const tide = { level_m: 1.2, source: "gauge", sd_m: 0.1, datum_epsg: 5715, datum_offset_m: -2.5 };
  const wrong = { depth_m: 0.1, roll_offset_deg: 0.4, sound_speed_mps: 3 };
  const spec = {
    ...toMission(draft),
    kind: "survey",
    search: null,
    tide,
    sound_speed: { name: "pier", profile: [[0, 1510]], further: [] },
    systematic_errors: { vehicles: { "sim-1": wrong }, water_level: [[1_795_225_140, 0.2]], source: "lines" },
  } as unknown as MissionView["spec"];

  it("of the day of a survey are in no copy of it; its datum and its instruments' errors are", () => {
    const copy = copyOf({ name: "Quay", spec });
    expect([copy.tide_m, copy.tide_source]).toEqual(["", ""]);
    const again = toMission(copy);
    expect(again).not.toHaveProperty("sound_speed");
    expect(again.tide).toEqual({ datum_epsg: 5715, datum_offset_m: -2.5 });
    expect(again.systematic_errors).toEqual({
      vehicles: { "sim-1": { ...wrong, sound_speed_mps: 0 } },
      water_level: [],
      source: "lines",
    });
    expect(hasDaysWater(spec as Partial<NewMission>)).toBe(true);
    expect(hasDaysWater(again)).toBe(false);
  });

  it("stay in a mission that is edited", () => {
    const made = toMission(draftFrom({ name: "Quay", spec }));
    const { tide: level, sound_speed, systematic_errors } = spec;
    expect(made).toMatchObject({ name: "Quay", tide: level, sound_speed, systematic_errors });
  });
});

describe("recovery", () => {
  const homing = {
    ...draft,
    simulated: "2",
    recovery: "41.184, -8.705",
    recovery_radius_m: "40",
    on_lost_link: "stop",
    own: { "sim-2": { altitude_m: "4", endurance_min: "90", recovery_point: "41.1845, -8.706" } },
  };

  it("is sent with its point as [longitude, latitude], and copied with what vehicles have of their own", () => {
    const mission = toMission(homing);
    expect(mission.recovery).toEqual({
      point: [-8.705, 41.184],
      radius_m: 40,
      on_finish: "return",
      on_low_energy: "return",
      on_lost_link: "stop",
      wait_for_batteries: false,
    });
    expect(mission.vehicles[1]).toMatchObject({
      altitude_m: 4,
      endurance_min: 90,
      recovery_point: [-8.706, 41.1845],
    });
    const spec = { tide: {}, search: null, ...mission } as unknown as MissionView["spec"];
    const copy = copyOf({ name: "Quay", spec });
    expect([copy.recovery, copy.recovery_radius_m]).toEqual(["41.184000, -8.705000", "40"]);
    expect(toMission(copy)).toMatchObject({ recovery: mission.recovery, vehicles: mission.vehicles });
    expect(toMission({ ...copy, recovery: "" })).not.toHaveProperty("recovery");
  });

  it("is left out without a point, whatever else stands in the form", () => {
    expect(faultsOf({ ...homing, recovery: " ", recovery_radius_m: "wide" })).toEqual({});
    expect(toMission({ ...homing, recovery: "" })).not.toHaveProperty("recovery");
  });

  it("has its faults named", () => {
    expect(faultsOf({ ...homing, recovery: "quay" }).recovery).toContain("Pick the recovery point");
    expect(
      faultsOf({ ...homing, own: { "sim-1": { endurance_min: "0" } } })["own.sim-1.endurance_min"],
    ).toContain("Endurance of sim-1");
    expect(
      faultsOf({ ...homing, own: { "sim-1": { recovery_point: "91, 0" } } })["own.sim-1.recovery_point"],
    ).toContain("Recovery point of sim-1");
  });
});

describe("a site", () => {
  it("goes with a survey and its copy, and with no search", () => {
    const draft = { ...emptyDraft([-8.7, 41.2]), name: "Quay", site: "s-1" };
    const mission = toMission(draft);
    expect(mission.site).toBe("s-1");
    const copy = copyOf({ name: "Quay", spec: { tide: {}, ...mission } as unknown as MissionView["spec"] });
    expect(copy.site).toBe("s-1");
    expect(toMission({ ...copy, site: "" })).not.toHaveProperty("site");
    expect(fieldOf("site", draft)).toBe("site");
  });
});

it("lines so far apart ask of each vehicle its share of the way, also when the area changes", () => {
  const draft = { ...emptyDraft([-8.7, 41.2]), name: "Lines", spacing_m: "10", simulated: "2" };
  const small = { ...draft, east_m: "200", north_m: "100" };
  expect(toMission(small).budget).toEqual({ km_per_vehicle: 1 });
  expect(toMission({ ...small, north_m: "200" }).budget).toEqual({ km_per_vehicle: 2 });
  expect(estimate(small, 20_000)?.spacing_m).toBeCloseTo(10, 1);
  expect(faultsOf({ ...small, spacing_m: "0" }).spacing_m).toContain("Distance of lines must be more than 0");
});

it("tells whether each vehicle's energy lasts, and how far it is from home", () => {
  const draft = {
    ...emptyDraft([-8.7, 41.2]),
    ...{ length: "minutes" as const, minutes: "30", recovery: "41.2, -8.7", east_m: "100", north_m: "100" },
    own: { "sim-2": { endurance_min: "20" } },
  };
  const found = estimate(draft, 10_000);
  expect(found?.shares.map(({ seconds, endurance_s }) => [Math.round(seconds), endurance_s])).toEqual([
    [1800, null],
    [1800, 1200],
  ]);
  expect(found?.farthest_m).toBeCloseTo(Math.hypot(50, 50), 0);
});
