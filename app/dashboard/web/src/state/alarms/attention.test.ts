import { describe, expect, test } from "vitest";
import type { AlarmReport, AlarmView, MissionView, VehicleView } from "../../api/types";
import { mattersOf, toldWords } from "./attention";

const vehicle = (name: string, changes: Partial<VehicleView> = {}) =>
  ({
    name,
    active: true,
    phase: "survey",
    withdrawn: "",
    failsafes: [],
    recovery_point: [-8.7, 41.18],
    left_at: null,
    ...changes,
  }) as unknown as VehicleView;

const mission = (vehicles: VehicleView[], changes: Partial<MissionView> = {}) =>
  ({
    id: "m1",
    state: "running",
    ending: null,
    reason: "",
    updated_at: "2026-06-01T10:00:00Z",
    vehicles,
    ...changes,
  }) as unknown as MissionView;

const alarm = (id: string, severity: AlarmView["severity"], raised_at: string) =>
  ({
    id,
    severity,
    raised_at,
    vehicle: "a",
    message: `alarm ${id}`,
    action: "look for it",
    ended_at: null,
  }) as AlarmView;

describe("what needs a person", () => {
  test("alarms come first, the newest of them at the top, each with what to do", () => {
    const found = mattersOf(mission([vehicle("a", { phase: "stopped", withdrawn: "held by Ana" })]), [
      alarm("old", "critical", "2026-06-01T10:00:00Z"),
      alarm("small", "minor", "2026-06-01T10:20:00Z"),
      alarm("new", "major", "2026-06-01T10:10:00Z"),
    ]);
    expect(found.map(({ what }) => what)).toEqual([
      "alarm new",
      "alarm old",
      "alarm small",
      "a waits: held by Ana",
    ]);
    expect(found[0]).toMatchObject({
      todo: "look for it",
      since: Date.parse("2026-06-01T10:10:00Z"),
      tone: "alarm",
    });
  });

  test("what an open alarm of a vehicle says is not said once more as a warning", () => {
    const lost = { failsafe: "link_lost", response: "warn", message: "silent" } as const;
    const close = { failsafe: "separation_lost", response: "warn", message: "b is near" } as const;
    const told = { ...alarm("one", "critical", "2026-06-01T10:00:00Z"), kind: "link_lost" } as AlarmView;
    const here = mission([vehicle("a", { failsafes: [lost, close] })]);
    expect(mattersOf(here, [told]).map(({ what }) => what)).toEqual(["alarm one", "a: b is near"]);
    // Somebody took it, and it goes on.
    expect(mattersOf(here, []).map(({ what }) => what)).toEqual(["a: silent", "a: b is near"]);
  });

  test("an alarm whose cause is over stays, no louder than a warning", () => {
    const over = { ...alarm("over", "critical", "2026-06-01T10:00:00Z"), ended_at: "2026-06-01T10:07:00Z" };
    expect(mattersOf(null, [over])[0]).toMatchObject({ tone: "warning", alarm: over });
    expect(mattersOf(null, [over])[0]?.todo).toContain("over since 10:07");
  });

  test("vehicles that are out with nobody to lead them, and those that are home, are told of", () => {
    const found = mattersOf(
      mission([
        vehicle("a"),
        vehicle("b", { phase: "home", withdrawn: "called home" }),
        vehicle("d", { phase: "home", withdrawn: "it has flown its way", part_done: true }),
        vehicle("c", { active: false, left_at: "2026-06-01T10:05:00Z", phase: null }),
      ]),
      [],
    );
    expect(found.map(({ vehicle: name, tone }) => [name, tone])).toEqual([
      ["c", "warning"],
      ["b", "calm"],
      ["d", "calm"],
    ]);
    expect(found[0]?.todo).toContain("bring it home");
    expect(found[1]?.todo).toContain("with a new battery");
    expect(found[2]?.todo).toContain("its part is flown");
  });

  test("nothing of a mission that ended, and a pause of one that did not", () => {
    const left = vehicle("c", { active: false, phase: null });
    expect(mattersOf(mission([left], { state: "finished" }), [])).toEqual([]);
    expect(mattersOf(mission([], { state: "paused" }), [])[0]?.what).toBe("The mission is paused");
    expect(mattersOf(mission([], { reason: "nothing can be written down" }), [])[0]?.tone).toBe("warning");
    expect(mattersOf(null, [])).toEqual([]);
  });
});

test("who was told, and whom that did not reach, is said in words", () => {
  const told = (changes: object) => ({
    recipient: "phone",
    notice: "raised",
    state: "delivered",
    created_at: "2026-06-01T10:00:00Z",
    done_at: "2026-06-01T10:00:03Z",
    error: "",
    ...changes,
  });
  const report = {
    deliveries: [
      told({}),
      told({
        recipient: "chief",
        notice: "escalated",
        created_at: "2026-06-01T10:05:00Z",
        done_at: "2026-06-01T10:05:01Z",
      }),
      told({
        recipient: "mast",
        state: "failed",
        error: "connection refused",
        created_at: "2026-06-01T09:59:00Z",
      }),
      told({ state: "superseded", created_at: "2026-06-01T10:06:00Z" }),
    ],
  } as unknown as AlarmReport;
  expect(toldWords(report)).toBe(
    "chief was told at 10:05, as nobody took it; phone was told at 10:00; mast could not be told: connection refused",
  );
});
