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
import { named, say } from "../words/say";
import { clock, count, duration, fixed, minutes, percent, plain } from "./format";

export const MISSION_WORDS: Record<MissionState, string> = {
  get draft() {
    return say("state.draftNeedsAVehicle");
  },
  get ready() {
    return say("state.readyToStart");
  },
  get running() {
    return say("state.running");
  },
  get paused() {
    return say("state.paused");
  },
  get finished() {
    return say("state.finished");
  },
  get aborted() {
    return say("state.aborted");
  },
  get failed() {
    return say("state.failed");
  },
};

type Stage = Pick<MissionView, "state" | "ending">;

/** What a mission is at; one that is ending brings its vehicles home first. */
export const missionWords = ({ state, ending }: Stage): string =>
  ending
    ? say("state.returningHomeThen", { becomes: MISSION_WORDS[ending].toLowerCase() })
    : MISSION_WORDS[state];

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
  get planned() {
    return say("state.plannedNotSentYet");
  },
  get sent() {
    return say("state.sentNotAcknowledgedYet");
  },
  get acknowledged() {
    return say("state.acknowledged");
  },
  get reached() {
    return say("state.reached");
  },
  get refused() {
    return say("state.refused");
  },
  get missed() {
    return say("state.missedItsDeadline");
  },
};

export const PHASE_WORDS: Record<Phase, string> = {
  get transit() {
    return say("state.inTransit");
  },
  get survey() {
    return say("state.surveying");
  },
  get surfacing() {
    return say("state.surfacing");
  },
  get returning() {
    return say("state.returningHome");
  },
  get home() {
    return say("state.home");
  },
  get stopped() {
    return say("state.stopped");
  },
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
> & { search?: Pick<NonNullable<MissionView["progress"]["search"]>, "left_s"> | null };

const ofWhole = (whole: number, left: number, unit: string): string =>
  say("state.of", {
    whole: fixed(Math.max(whole - left, 0), whole < 10 ? 1 : 0),
    whole2: plain(whole),
    unit,
  });

/** How far a mission has come, in the unit of its length; a search may take any number of steps within its time. */
export function lengthWords(progress: Progress): string {
  const { search, step, steps } = progress;
  if (!search) return flownWords(progress) ?? say("state.stepOf", { step, steps });
  const time = duration(Math.abs(search.left_s));
  return say(search.left_s < 0 ? "state.beyondItsTime" : "state.leftOfItsTime", { time });
}

const LINK_WORDS: Record<LinkState, string> = {
  get unknown() {
    return say("state.neverHeard");
  },
  get lost() {
    return say("state.noContact");
  },
  get expected_offline() {
    return say("state.offlineByPlan");
  },
  get heard() {
    return say("state.heardNotReady");
  },
  get ready() {
    return say("state.ready");
  },
  get engaged() {
    return say("state.underWay");
  },
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

type Comer = Pick<VehicleView, "active" | "phase" | "return_needs_s">;

/** What is left of a running mission, seconds: when all is surveyed, until the last vehicle is home; null: not known. */
export function remaining_s(eta_s: number | null, vehicles: readonly Comer[]): number | null {
  if (eta_s === null || eta_s >= 1) return eta_s;
  const coming = vehicles.filter(({ active, phase }) => active && phase === "returning");
  return Math.max(0, ...coming.map(({ return_needs_s }) => return_needs_s ?? 0));
}

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

export const failsafeWords = ({ failsafe }: FailsafeView): string =>
  named("failsafe", failsafe, capital(failsafe.replaceAll("_", " ")));

/** What was told before the service fell silent: good news is no news of now. */
export const whenLastHeard = ({ words, tone }: Told): Told => ({
  words: say("topBar.whenLastHeard", { words }),
  tone: tone === "good" ? "calm" : tone,
});

/** A vehicle's state as one short line and how loud it is. */
export function vehicleState(vehicle: VehicleView, waypoint: WaypointView | undefined): Told {
  const found = stateOf(vehicle, waypoint);
  const tones = vehicle.active ? vehicle.failsafes.map((one) => failsafeTone(one, vehicle)) : [];
  if (tones.includes("alarm")) return { ...found, tone: "alarm" };
  return tones.length > 0 && found.tone !== "alarm" ? { ...found, tone: "warning" } : found;
}

function stateOf(vehicle: VehicleView, waypoint: WaypointView | undefined): Told {
  if (!vehicle.active) return { words: say("state.leftTheMission"), tone: "calm" };
  if (vehicle.breach) return { words: capital(vehicle.breach), tone: "alarm" };
  if (isHome(vehicle)) return { words: say("state.home2"), tone: "good" };
  // It is launched when the mission starts and put away when that ends: nothing to worry about.
  if (vehicle.kind === "sim" && vehicle.link === "unknown")
    return {
      words: vehicle.lat_deg === null ? say("state.notLaunched") : say("state.simulationOver"),
      tone: "calm",
    };
  const tone = LINK_TONES[vehicle.link];
  if (vehicle.waiting_circle && vehicle.link !== "lost") return { words: say("state.waitsInCircles"), tone };
  if (vehicle.withdrawn && vehicle.phase && vehicle.link !== "lost")
    return { words: capital(PHASE_WORDS[vehicle.phase]), tone };
  if (vehicle.link !== "engaged" || !waypoint) return { words: LINK_WORDS[vehicle.link], tone };
  switch (waypoint.status) {
    case "acknowledged":
      return { words: say("state.toWaypoint", { step: waypoint.step }), tone };
    case "reached":
      return { words: say("state.atWaypoint", { step: waypoint.step }), tone };
    case "refused":
      return { words: say("state.refusedWaypoint", { step: waypoint.step }), tone: "alarm" };
    case "missed":
      return { words: say("state.missedWaypoint", { step: waypoint.step }), tone: "warning" };
    default:
      return { words: say("state.waypointNotAcknowledged", { step: waypoint.step }), tone: "calm" };
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
  return [
    say("state.multibeam", { apertureDeg: plain(aperture_deg) }),
    say("state.beams", { beams }),
    `${plain(rate_hz)} Hz`,
    say("state.reachesM", { rangeM: plain(range_m) }),
  ];
}

/** What was measured: soundings, and beams where there are any. */
export const measuredWords = ({
  soundings,
  beams,
}: Pick<MissionView["progress"], "soundings" | "beams">): string =>
  beams === 0
    ? say("state.soundings", { soundings: count(soundings) })
    : say("state.beams2", {
        it: soundings === 0 ? "" : say("state.soundings2", { soundings: count(soundings) }),
        beams: count(beams),
      });

type Range = Withdrawn & Pick<VehicleView, "energy_left_s" | "turn_back_at" | "return_needs_s">;

/** How long a vehicle's energy lasts, how far it is from home, and when it has to turn back; what is not known is left out. */
export function rangeWords(vehicle: Range, now: number): string[] {
  const { energy_left_s, turn_back_at, return_needs_s } = vehicle;
  const parts: string[] = [];
  if (energy_left_s !== null) parts.push(say("state.left", { energyLeftS: minutes(energy_left_s) }));
  if (return_needs_s !== null && !isThere(vehicle))
    parts.push(say("state.wayHomeTakes", { returnNeedsS: minutes(return_needs_s) }));
  if (turn_back_at !== null) {
    const at = new Date(turn_back_at);
    const in_s = (at.getTime() - now) / 1000;
    const when = in_s > 0 ? say("state.in", { inS: minutes(in_s) }) : say("state.now");
    parts.push(say("state.turnBackAtUtc", { at: clock(at, "utc").slice(0, 5), when }));
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

/** Whether a mission's vehicles have been sent out. */
export const hasStarted = ({ state }: Pick<MissionView, "state">): boolean =>
  state !== "draft" && state !== "ready";

/** Whether nothing can be asked of a mission any more. */
export const hasEnded = (mission: Allowed): boolean => mission.allowed_actions.length === 0;
