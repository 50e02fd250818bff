import { describe, expect, it } from "vitest";
import type { AlarmView, EventView, LiveMessage, MissionView, VehicleView, WaypointView } from "../api/types";
import {
  ageSeconds,
  allDecided,
  allWait,
  EMPTY_VIEW,
  type LiveView,
  nextOf,
  reduce,
  withEvents,
  withMission,
} from "./live";

const vehicle = (
  name: string,
  lon: number | null,
  lat: number | null,
  age_s: number | null = 0,
): VehicleView => ({
  name,
  kind: "sim",
  sensor: "dvl",
  swath_m: null,
  mission_id: "m",
  active: true,
  left_at: null,
  breach: "",
  link: "engaged",
  reason: "",
  age_s,
  address: null,
  imc_id: null,
  lat_deg: lat,
  lon_deg: lon,
  east_m: null,
  north_m: null,
  depth_m: 2,
  altitude_m: null,
  heading_deg: null,
  speed_mps: null,
  battery_pct: null,
  battery: null,
  position_sd_m: null,
  localization: "stated",
  surfacing: false,
  risings: 0,
  pursuing: null,
  phase: null,
  flown_m: 0,
  on_plan_m: 0,
  idle_s: 0,
  order: null,
  withdrawn: "",
  part_done: false,
  energy_left_pct: null,
  energy_left_s: null,
  recovery_point: null,
  return_needs_s: null,
  turn_back_at: null,
  turn_back_point: null,
  way_home: [],
  waiting_circle: null,
  failsafes: [],
});

const waypoint = (name: string, step: number, status: WaypointView["status"]): WaypointView => ({
  vehicle: name,
  step,
  status,
  reason: "",
  lat_deg: 0,
  lon_deg: 0,
  east_m: 0,
  north_m: 0,
  depth_m: 2,
  speed_mps: 1,
  arrival_radius_m: 3,
  way_home: [],
  min_altitude_m: 1,
});

const mission = (id: string): MissionView =>
  ({
    id,
    name: id,
    state: "running",
    vehicles: [vehicle("a", 1, 1)],
    waypoints: [waypoint("a", 3, "sent")],
    spec: { budget: { minutes: 60 }, steps: 360 },
    progress: { budget: { minutes: 60 }, steps: 360 },
  }) as MissionView;

const snapshot = (id: string): LiveMessage => ({
  type: "snapshot",
  mission: mission(id),
  alarms: [],
  tracks: { a: [[1, 1, 2]] },
  map_version: 4,
  last_event_id: 0,
});

const event = (id: number): EventView => ({
  id,
  mission_id: "m",
  time: "2026-01-01T00:00:00Z",
  level: "info",
  kind: "step",
  message: `line ${id}`,
  data: {},
});

const started = reduce(EMPTY_VIEW, snapshot("m"), 1000);

describe("live messages", () => {
  it("mean nothing before the first snapshot", () => {
    expect(
      reduce(EMPTY_VIEW, { type: "vehicles", current: null, time: "", vehicles: [vehicle("a", 1, 1)] }, 1),
    ).toBe(EMPTY_VIEW);
  });

  it("extend a track only when the vehicle has moved", () => {
    const still = reduce(
      started,
      { type: "vehicles", current: null, time: "", vehicles: [vehicle("a", 1 + 1e-7, 1)] },
      2000,
    );
    expect(still.tracks).toBe(started.tracks);
    const moved = reduce(
      still,
      {
        type: "vehicles",
        current: null,
        time: "",
        vehicles: [vehicle("a", 1.1, 1), vehicle("b", null, null)],
      },
      3000,
    );
    expect(moved.tracks.a).toEqual({
      old: [[1, 1, 2]],
      tail: [
        [1, 1, 2],
        [1.1, 1, 2],
      ],
    });
    // What is drawn seldom stays the same object.
    expect(moved.tracks.a?.old).toBe(started.tracks.a?.old);
    expect(started.tracks.a).toEqual({ old: [[1, 1, 2]], tail: [[1, 1, 2]] });
  });

  it("replace a waypoint by its next state and by later steps, never by earlier ones", () => {
    let view = reduce(
      started,
      { type: "waypoints", waypoints: [waypoint("a", 3, "acknowledged"), waypoint("b", 3, "sent")] },
      1,
    );
    view = reduce(view, { type: "waypoints", waypoints: [waypoint("a", 2, "missed")] }, 2);
    expect(view.mission?.waypoints.map((w) => [w.vehicle, w.step, w.status])).toEqual([
      ["a", 3, "acknowledged"],
      ["b", 3, "sent"],
    ]);
  });

  it("tell of the current with the vehicles", () => {
    const current = { speed_mps: 0.3, toward_deg: 74 };
    const told = reduce(started, { type: "vehicles", time: "", vehicles: [], current }, 2);
    expect(told.mission?.current).toEqual(current);
  });

  it("change the mission's state and keep its vehicles", () => {
    const view = reduce(started, { type: "mission", mission: { ...mission("m"), state: "paused" } }, 5000);
    expect(view.mission?.state).toBe("paused");
    expect(view.mission?.vehicles).toHaveLength(1);
    expect(view.progressAt).toBe(5000);
  });

  it("change the mission's length in what it is to do, too", () => {
    const longer = mission("m");
    longer.progress.budget.minutes = 80;
    longer.progress.steps = 480;
    const view = reduce(started, { type: "mission", mission: longer }, 5000);
    expect(view.mission?.spec).toEqual({ budget: { minutes: 80 }, steps: 480 });
  });

  it("keep a long track within bounds and its newest point exact", () => {
    let view = started;
    for (let i = 1; i <= 9000; i++) {
      view = reduce(
        view,
        { type: "vehicles", current: null, time: "", vehicles: [vehicle("a", 1 + i / 1000, 1)] },
        i,
      );
    }
    expect(view.tracks.a?.old.length).toBeLessThanOrEqual(8200);
    expect(view.tracks.a?.tail.at(-1)).toEqual([10, 1, 2]);
    expect(view.tracks.a?.old[0]).toEqual([1, 1, 2]);
  });
});

describe("the log", () => {
  it("has each line once, in order, whichever way it came", () => {
    const view = withEvents(reduce(started, { type: "event", event: event(3) }, 1), [
      event(1),
      event(2),
      event(3),
    ]);
    expect(view.events.map((e) => e.id)).toEqual([1, 2, 3]);
  });

  it("stays over a reconnection to the same mission and is dropped for another", () => {
    const view = withEvents(started, [event(1)]);
    expect(reduce(view, snapshot("m"), 2).events).toHaveLength(1);
    expect(reduce(view, snapshot("other"), 2).events).toHaveLength(0);
  });
});

describe("age", () => {
  it("goes on counting from what the service said", () => {
    expect(ageSeconds(vehicle("a", 1, 1, 0.5), 10_000, 12_000)).toBeCloseTo(2.5);
  });

  it("does not run backwards, and is unknown for a vehicle never heard", () => {
    expect(ageSeconds(vehicle("a", 1, 1, 0.5), 10_000, 9000)).toBe(0.5);
    expect(ageSeconds(vehicle("a", 1, 1, null), 0, 9000)).toBeNull();
  });
});

it("shows a mission that was asked for, and what the live view tells in its place", () => {
  const asked = withMission(EMPTY_VIEW, mission("m"), 5000);
  expect(asked.mission?.vehicles).toHaveLength(1);
  expect(ageSeconds(vehicle("a", 1, 1, 2), asked.vehiclesAt, 6000)).toBe(3);
  const told = reduce(
    asked,
    { type: "vehicles", current: null, time: "2026-11-21T12:00:00Z", vehicles: [vehicle("a", 1, 2)] },
    7000,
  );
  expect(told.tracks.a?.tail).toHaveLength(1);
});

describe("alarms", () => {
  const alarm = (id: string, raised_at: string, by: string | null = null): AlarmView => ({
    id,
    mission_id: "m",
    action: "wait for it to be heard again",
    kind: "vehicle_lost",
    severity: "major",
    vehicle: "a",
    message: `${id} is lost`,
    raised_at,
    ended_at: null,
    state: by === null ? "open" : "acknowledged",
    acknowledged_at: by === null ? null : raised_at,
    acknowledged_by: by,
  });

  it("are shown once and go when anybody takes them, on whichever page", () => {
    const later = alarm("later", "2026-01-01T00:00:02Z");
    const sooner = alarm("sooner", "2026-01-01T00:00:01Z");
    let view = reduce(EMPTY_VIEW, { ...snapshot("m"), alarms: [later] } as LiveMessage, 1);
    for (const one of [sooner, later, sooner]) view = reduce(view, { type: "alarm", alarm: one }, 2);
    expect(view.alarms.map(({ id }) => id)).toEqual(["sooner", "later"]);
    const taken = alarm("later", later.raised_at, "Ana");
    view = reduce(view, { type: "alarm", alarm: taken }, 3);
    expect(view.alarms).toEqual([sooner]);
    expect(view.taken?.acknowledged_by).toBe("Ana");
    expect(reduce(view, snapshot("other"), 4).taken).toBeNull();
  });
});

describe("who follows a mission", () => {
  const finished = (by: string) => ({
    mission: { ...mission("m"), state: "finished" as const },
    events: [{ kind: "state", data: { state: "finished", actor: by } }] as never,
  });
  const list = [
    { id: "other", after: null, state: "running" as const },
    { id: "next", after: "m", state: "ready" as const },
  ];

  it("is the one that begins, or waits for a person, once that one was flown to its end", () => {
    expect(nextOf(finished("service"), list)).toBe("next");
    expect(nextOf(finished("service"), [{ id: "next", after: "m", state: "running" }])).toBe("next");
    expect(nextOf(finished("service"), [{ id: "next", after: "m", state: "aborted" }])).toBeNull();
    expect(nextOf({ ...finished("service"), mission: mission("m") }, list)).toBeNull();
  });

  it("is nobody after what a person finished: what vehicles answered is still to be read", () => {
    expect(nextOf(finished("Ana"), list)).toBeNull();
  });
});

describe("whether a step is to come", () => {
  const left = { minutes_left: 12, km_left_per_vehicle: 0.7 };
  const length = { minutes: null, km_per_vehicle: null, steps: null };
  const many = { step: 92, steps: 92 };

  it("goes by the steps of a mission that is counted in them", () => {
    const budget = { ...length, steps: 40 };
    expect(allDecided({ ...left, budget, step: 39, steps: 40 })).toBe(false);
    expect(allDecided({ ...left, budget, step: 40, steps: 40 })).toBe(true);
  });
  it("goes by what is left to fly in any other, however many legs that took", () => {
    expect(allDecided({ ...left, ...many, budget: { ...length, minutes: 30 } })).toBe(false);
    expect(allDecided({ ...left, ...many, budget: { ...length, km_per_vehicle: 2 } })).toBe(false);
    const none = { minutes_left: 0, km_left_per_vehicle: 0 };
    expect(allDecided({ ...none, ...many, budget: { ...length, minutes: 30 } })).toBe(true);
  });
});

it("has vehicles wait for a decision only while somebody surveys", () => {
  const of = (withdrawn: string, status: WaypointView["status"]) => ({
    view: { ...vehicle("a", 0, 0), withdrawn },
    waypoint: waypoint("a", 1, status),
  });
  expect(allWait([of("", "reached"), of("called home by Ana", "acknowledged")])).toBe(true);
  expect(allWait([of("", "acknowledged"), of("held by Ana", "reached")])).toBe(false);
  expect(allWait([of("held by Ana", "reached"), of("called home by Ana", "reached")])).toBe(false);
});

it("the service's clock counts where the page's is wrong, not what messages take", () => {
  const at = Date.parse("2026-11-21T12:00:00Z");
  const shown = { ...EMPTY_VIEW, mission: { id: "m", waypoints: [] } as unknown as MissionView };
  const told = (view: typeof shown, late_ms: number) =>
    reduce(
      view,
      { type: "vehicles", current: null, time: "2026-11-21T12:00:00Z", vehicles: [] },
      at + late_ms,
    ) as typeof shown;
  expect(told(shown, 900).clockAhead_ms).toBe(0);
  const wrong = told(shown, -3_600_000);
  expect(wrong.clockAhead_ms).toBe(3_600_000);
  expect(told(wrong, -3_599_200).clockAhead_ms).toBe(3_600_000);
  expect(told(wrong, 100).clockAhead_ms).toBe(-100);
});

it("what vehicles tell goes on to be kept for charts when the device's clock is set back", () => {
  const heard = (view: LiveView, at: number) =>
    reduce(
      view,
      { type: "vehicles", current: null, time: new Date(at).toISOString(), vehicles: [vehicle("a", 0, 0)] },
      at,
    );
  const before = heard(withMission(EMPTY_VIEW, { vehicles: [] } as unknown as MissionView, 0), 7_200_000);
  const after = heard(before, 3_600_000);
  expect(after.samples.a).toHaveLength(2);
});
