/** States in the words an operator uses. */

import type {
  BatteryState,
  LinkState,
  MissionAction,
  MissionState,
  MissionView,
  Phase,
  Severity,
  VehicleView,
  WaypointStatus,
  WaypointView,
} from "../api/types";
import { percent } from "./format";

export const MISSION_WORDS: Record<MissionState, string> = {
  draft: "Draft, needs a vehicle",
  ready: "Ready to start",
  running: "Running",
  paused: "Paused",
  finished: "Finished",
  aborted: "Aborted",
  failed: "Failed",
};

/** A shape for each state, so that colour is never the only sign. */
export const MISSION_SIGNS: Record<MissionState, string> = {
  draft: "◌",
  ready: "○",
  running: "▶",
  paused: "❚❚",
  finished: "✓",
  aborted: "■",
  failed: "✕",
};

export const WAYPOINT_WORDS: Record<WaypointStatus, string> = {
  planned: "planned, not sent yet",
  sent: "sent, not acknowledged yet",
  acknowledged: "acknowledged",
  reached: "reached",
  refused: "refused",
  missed: "missed its deadline",
};

export const PHASE_WORDS: Record<Phase, string> = {
  transit: "in transit",
  survey: "surveying",
  surfacing: "surfacing",
  returning: "returning",
  home: "home",
  stopped: "stopped",
};

/** How far a mission has come in minutes or kilometres: "12 of 60 min"; null where it is counted in steps. */
export function flownWords({ budget, ...left }: Progress): string | null {
  const { minutes, km_per_vehicle } = budget ?? {};
  if (minutes != null && left.minutes_left !== null) return ofWhole(minutes, left.minutes_left, "min");
  if (km_per_vehicle != null && left.km_left_per_vehicle !== null)
    return ofWhole(km_per_vehicle, left.km_left_per_vehicle, "km");
  return null;
}

type Progress = Pick<
  MissionView["progress"],
  "budget" | "minutes_left" | "km_left_per_vehicle" | "step" | "steps"
>;

const ofWhole = (whole: number, left: number, unit: string): string =>
  `${Math.max(whole - left, 0).toFixed(whole < 10 ? 1 : 0)} of ${whole} ${unit}`;

/** How far a mission has come, in the unit of its length. */
export const lengthWords = (progress: Progress): string =>
  flownWords(progress) ?? `step ${progress.step} of ${progress.steps}`;

const LINK_WORDS: Record<LinkState, string> = {
  unknown: "Never heard",
  lost: "No contact",
  expected_offline: "Offline by plan",
  heard: "Heard, not ready",
  ready: "Ready",
  engaged: "Under way",
};

export type Tone = "calm" | "good" | "warning" | "alarm";

export const FINDING_TONES: Record<Severity, Tone> = { ok: "good", note: "warning", problem: "alarm" };
export const FINDING_SIGNS: Record<Severity, string> = { ok: "✓", note: "▲", problem: "✕" };

const LINK_TONES: Record<LinkState, Tone> = {
  unknown: "warning",
  lost: "alarm",
  expected_offline: "calm",
  heard: "warning",
  ready: "good",
  engaged: "good",
};

/** A vehicle's state as one short line and how loud it is. */
export function vehicleState(
  vehicle: VehicleView,
  waypoint: WaypointView | undefined,
): { words: string; tone: Tone } {
  if (!vehicle.active) return { words: "Left the mission", tone: "calm" };
  if (vehicle.breach) return { words: capital(vehicle.breach), tone: "alarm" };
  // It is launched when the mission starts and put away when that ends: nothing to worry about.
  if (vehicle.kind === "sim" && vehicle.link === "unknown")
    return { words: vehicle.lat_deg === null ? "Not launched" : "Simulation over", tone: "calm" };
  const tone = LINK_TONES[vehicle.link];
  if (vehicle.link !== "engaged" || !waypoint) return { words: LINK_WORDS[vehicle.link], tone };
  switch (waypoint.status) {
    case "acknowledged":
      return { words: `To waypoint ${waypoint.step}`, tone };
    case "reached":
      return { words: `At waypoint ${waypoint.step}`, tone };
    case "refused":
      return { words: `Refused waypoint ${waypoint.step}`, tone: "alarm" };
    case "missed":
      return { words: `Missed waypoint ${waypoint.step}`, tone: "warning" };
    default:
      return { words: `Waypoint ${waypoint.step} not acknowledged`, tone: "calm" };
  }
}

export const capital = (words: string): string => words.charAt(0).toUpperCase() + words.slice(1);

const BATTERY_SIGNS: Record<BatteryState, string> = { ok: "", low: "▲ ", critical: "✕ " };

/** A battery's level, with a sign where the service calls it low. */
export const batteryWords = ({ battery, battery_pct }: VehicleView): string =>
  `${BATTERY_SIGNS[battery ?? "ok"]}${percent(battery_pct)}`;

type Allowed = Pick<MissionView, "allowed_actions">;

export const isAllowed = (action: MissionAction, mission: Allowed): boolean =>
  mission.allowed_actions.includes(action);

/** Whether nothing can be asked of a mission any more. */
export const hasEnded = (mission: Allowed): boolean => mission.allowed_actions.length === 0;
