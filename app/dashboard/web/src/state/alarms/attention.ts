/** What needs a person: what, since when, and what to do about it. Pure. */

import type { AlarmReport, AlarmView, MissionView, VehicleView } from "../../api/types";
import { say } from "../../words/say";
import { clock } from "../format";

export interface Matter {
  key: string;
  tone: "alarm" | "warning" | "calm";
  what: string;
  /** What to do about it. */
  todo: string;
  /** Milliseconds; null: nobody noted it. */
  since: number | null;
  vehicle: string | null;
  /** The alarm, where it is one that somebody has to take. */
  alarm: AlarmView | null;
}

const LOUDNESS = { alarm: 0, warning: 1, calm: 2 };

/** All that needs a person, the loudest first, of these the newest. */
export function mattersOf(mission: MissionView | null, alarms: readonly AlarmView[]): Matter[] {
  const found = [
    ...alarms.map(ofAlarm),
    ...(mission
      ? [...ofMission(mission), ...mission.vehicles.flatMap((v) => ofVehicle(v, mission, alarms))]
      : []),
  ];
  return found.sort(
    (a, b) =>
      LOUDNESS[a.tone] - LOUDNESS[b.tone] || (b.since ?? 0) - (a.since ?? 0) || a.key.localeCompare(b.key),
  );
}

const ofAlarm = (alarm: AlarmView): Matter => ({
  key: `alarm ${alarm.id}`,
  // What is over needs nobody any more but one who has seen it.
  tone: alarm.severity === "minor" || alarm.ended_at !== null ? "warning" : "alarm",
  what: alarm.message,
  todo:
    alarm.ended_at === null
      ? alarm.action
      : say("attention.overSince", { time: clock(new Date(alarm.ended_at), "utc").slice(0, 5) }),
  since: Date.parse(alarm.raised_at),
  vehicle: alarm.vehicle,
  alarm,
});

function ofMission({ id, state, reason, updated_at }: MissionView): Matter[] {
  const since = Date.parse(updated_at);
  const matter = { key: `mission ${id}`, vehicle: null, alarm: null };
  if (state === "paused")
    return [
      {
        ...matter,
        tone: "warning",
        what: say("attention.paused"),
        todo: say("attention.resumeOrFinish"),
        since,
      },
    ];
  if (state === "running" && reason !== "")
    return [{ ...matter, tone: "warning", what: reason, todo: say("attention.readWhy"), since: null }];
  return [];
}

function ofVehicle(v: VehicleView, { state, ending }: MissionView, alarms: readonly AlarmView[]): Matter[] {
  const matter = { key: `vehicle ${v.name}`, vehicle: v.name, alarm: null, since: null };
  const led = state === "running" && ending === null;
  if (!v.active) {
    if (!led || v.phase === "home") return [];
    return [
      {
        ...matter,
        tone: "warning",
        what: say("attention.left", { name: v.name }),
        todo: say(v.recovery_point ? "attention.addHomeOrRecover" : "attention.addOrRecover"),
        since: v.left_at ? Date.parse(v.left_at) : null,
      },
    ];
  }
  const isTold = (failsafe: string) =>
    alarms.some((one) => one.kind === failsafe && one.vehicle === v.name && one.ended_at === null);
  const found: Matter[] = v.failsafes
    .filter(({ failsafe, response }) => response === "warn" && !isTold(failsafe))
    .map(({ failsafe, message }) => ({
      ...matter,
      key: `warning ${v.name} ${failsafe}`,
      tone: "warning",
      what: `${v.name}: ${message}`,
      todo: say("attention.watchIt"),
    }));
  if (led && v.phase === "home")
    found.push({
      ...matter,
      tone: "calm",
      what: say("attention.isHome", { name: v.name }),
      todo: say(v.part_done ? "attention.takeOut" : "attention.newBattery"),
    });
  else if (led && v.phase === "stopped" && v.withdrawn !== "")
    found.push({
      ...matter,
      tone: "warning",
      what: say("attention.waits", { name: v.name, why: v.withdrawn }),
      todo: say(v.recovery_point ? "attention.resumeOrHome" : "attention.resume"),
    });
  return found;
}

/** Who was told of an alarm and when, the newest first; empty when nobody was to be told yet. */
export function toldWords({ deliveries }: Pick<AlarmReport, "deliveries">): string {
  return [...deliveries]
    .sort((a, b) => b.created_at.localeCompare(a.created_at))
    .map(({ recipient, notice, state, done_at, error }) => {
      const after =
        notice === "escalated"
          ? say("attention.asNobodyTookIt")
          : notice === "ended"
            ? say("attention.thatItIsOver")
            : "";
      const at = done_at ? say("attention.at", { time: clock(new Date(done_at), "utc").slice(0, 5) }) : "";
      if (state === "delivered") return say("attention.wasTold", { recipient, at, after });
      if (state === "failed") return say("attention.couldNotBeTold", { recipient, error });
      return state === "waiting" ? say("attention.isBeingTold", { recipient, after }) : "";
    })
    .filter((words) => words !== "")
    .join("; ");
}
