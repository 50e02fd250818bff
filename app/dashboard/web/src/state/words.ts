/** States in the words an operator uses. */

import SPEC from "../api/mission.json";
import type {
  BatteryState,
  FailsafeView,
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
import { clock, count, minutes, percent } from "./format";

export const MISSION_WORDS: Record<MissionState, string> = {
  draft: "Draft, needs a vehicle",
  ready: "Ready to start",
  running: "Running",
  paused: "Paused",
  finished: "Finished",
  aborted: "Aborted",
  failed: "Failed",
};

type Stage = Pick<MissionView, "state" | "ending">;

/** What a mission is at; one that is ending brings its vehicles home first. */
export const missionWords = ({ state, ending }: Stage): string =>
  ending ? `Returning home; then ${MISSION_WORDS[ending].toLowerCase()}` : MISSION_WORDS[state];

/** A shape for each state, so that colour is never the only sign. */
const MISSION_SIGNS: Record<MissionState, string> = {
  draft: "◌",
  ready: "○",
  running: "▶",
  paused: "❚❚",
  finished: "✓",
  aborted: "■",
  failed: "✕",
};

export const missionSign = ({ state, ending }: Stage): string => (ending ? "⌂" : MISSION_SIGNS[state]);

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
  returning: "returning home",
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

type Withdrawn = Pick<VehicleView, "withdrawn" | "phase" | "failsafes">;

/** Whether a vehicle has come to where it was sent instead of surveying: home, up, stopped. */
export const isThere = ({ withdrawn, phase, failsafes }: Withdrawn): boolean =>
  withdrawn !== "" &&
  (phase === "home" || (phase === "stopped" && !failsafes.some(({ response }) => response === "hold")));

const isHome = (vehicle: Withdrawn): boolean => isThere(vehicle) && vehicle.phase === "home";

type Homing = Withdrawn & Pick<VehicleView, "active" | "recovery_point">;

/** Whether any vehicle can be brought home before its mission ends. */
export const canReturn = (mission: Stage, vehicles: readonly Homing[]): boolean =>
  (mission.state === "running" || mission.state === "paused") &&
  mission.ending === null &&
  vehicles.some((v) => v.active && v.recovery_point !== null && !isThere(v));

interface Told {
  words: string;
  tone: Tone;
}

/** How loud a failsafe is; one that sent its vehicle home is less so once that is there. */
export const failsafeTone = ({ response }: FailsafeView, of: VehicleView): "warning" | "alarm" =>
  response === "warn" || (response === "return" && isHome(of)) ? "warning" : "alarm";

export const failsafeWords = ({ failsafe }: FailsafeView): string => capital(failsafe.replaceAll("_", " "));

/** A vehicle's state as one short line and how loud it is. */
export function vehicleState(vehicle: VehicleView, waypoint: WaypointView | undefined): Told {
  const found = stateOf(vehicle, waypoint);
  const tones = vehicle.active ? vehicle.failsafes.map((one) => failsafeTone(one, vehicle)) : [];
  if (tones.includes("alarm")) return { ...found, tone: "alarm" };
  return tones.length > 0 && found.tone !== "alarm" ? { ...found, tone: "warning" } : found;
}

function stateOf(vehicle: VehicleView, waypoint: WaypointView | undefined): Told {
  if (!vehicle.active) return { words: "Left the mission", tone: "calm" };
  if (vehicle.breach) return { words: capital(vehicle.breach), tone: "alarm" };
  if (isHome(vehicle)) return { words: "Home", tone: "good" };
  // It is launched when the mission starts and put away when that ends: nothing to worry about.
  if (vehicle.kind === "sim" && vehicle.link === "unknown")
    return { words: vehicle.lat_deg === null ? "Not launched" : "Simulation over", tone: "calm" };
  const tone = LINK_TONES[vehicle.link];
  if (vehicle.withdrawn && vehicle.phase && vehicle.link !== "lost")
    return { words: capital(PHASE_WORDS[vehicle.phase]), tone };
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

type Carrier = Pick<VehicleView, "name" | "sensor">;

/** What a vehicle's swath sonar can do; nothing where it has none. */
export function sonarWords(
  { name, sensor }: Carrier,
  described: MissionView["spec"]["vehicles"] = [],
): string[] {
  if (sensor !== "multibeam") return [];
  const sonar = described.find((one) => one.name === name)?.sonar;
  const {
    aperture_deg = SPEC["vehicles.sonar.aperture_deg"].default,
    beams = SPEC["vehicles.sonar.beams"].default,
    rate_hz = SPEC["vehicles.sonar.rate_hz"].default,
    range_m = SPEC["vehicles.sonar.range_m"].default,
  } = sonar ?? {};
  return [`multibeam ${aperture_deg}°`, `${beams} beams`, `${rate_hz} Hz`, `reaches ${range_m} m`];
}

/** What was measured: soundings, and beams where there are any. */
export const measuredWords = ({
  soundings,
  beams,
}: Pick<MissionView["progress"], "soundings" | "beams">): string =>
  beams === 0
    ? `${count(soundings)} soundings`
    : `${soundings === 0 ? "" : `${count(soundings)} soundings, `}${count(beams)} beams`;

type Range = Withdrawn & Pick<VehicleView, "energy_left_s" | "turn_back_at" | "return_needs_s">;

/** How long a vehicle's energy lasts, how far it is from home, and when it has to turn back; what is not known is left out. */
export function rangeWords(vehicle: Range, now: number): string[] {
  const { energy_left_s, turn_back_at, return_needs_s } = vehicle;
  const parts: string[] = [];
  if (energy_left_s !== null) parts.push(`${minutes(energy_left_s)} left`);
  if (return_needs_s !== null && !isThere(vehicle)) parts.push(`way home takes ${minutes(return_needs_s)}`);
  if (turn_back_at !== null) {
    const at = new Date(turn_back_at);
    const in_s = (at.getTime() - now) / 1000;
    const when = in_s > 0 ? `in ${minutes(in_s)}` : "now";
    parts.push(`turn back at ${clock(at, "utc").slice(0, 5)} UTC (${when})`);
  }
  return parts;
}

const withoutFigures = (words: string) => words.replace(/[\d.]+/g, "");

/** Whether a failsafe of a vehicle says this already, be it with other figures. */
export const isSaid = (words: string, { failsafes }: Pick<VehicleView, "failsafes">): boolean =>
  failsafes.some(({ message }) => withoutFigures(message).includes(withoutFigures(words)));

type Allowed = Pick<MissionView, "allowed_actions">;

export const isAllowed = (action: MissionAction, mission: Allowed): boolean =>
  mission.allowed_actions.includes(action);

/** Whether nothing can be asked of a mission any more. */
export const hasEnded = (mission: Allowed): boolean => mission.allowed_actions.length === 0;
