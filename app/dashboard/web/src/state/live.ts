/** What the page knows of one mission, and how each live message changes it. Pure: no socket, no page, no clock. */

import type {
  AlarmView,
  EventView,
  LiveMessage,
  MissionSummary,
  MissionView,
  OwnShipView,
  Place,
  ShipView,
  VehicleView,
  WaypointView,
} from "../api/types";

/** A vehicle's way: the long part behind it, which changes seldom, and the newest part, which begins where that ends. */
export interface TrackView {
  old: readonly Place[];
  tail: readonly Place[];
}

/** What a vehicle told at one moment, for the charts. */
export interface Sample {
  /** By the service's clock, milliseconds. */
  at: number;
  depth_m: number | null;
  altitude_m: number | null;
  battery_pct: number | null;
  age_s: number | null;
}

export interface LiveView {
  mission: MissionView | null;
  tracks: Readonly<Record<string, TrackView>>;
  /** One a second, the newest hour; replaced once a second. */
  samples: Readonly<Record<string, readonly Sample[]>>;
  sampledAt: number;
  events: readonly EventView[];
  /** Alarms that nobody has acknowledged, oldest first, and the one that was last. */
  alarms: readonly AlarmView[];
  taken: AlarmView | null;
  /** Ships near the mission; null: nothing listens for any. */
  ships: readonly ShipView[] | null;
  /** Where the own ship was when that was told last; null: not lately. */
  ownShip: OwnShipView | null;
  mapVersion: number;
  /** Grows with what was sounded since that map. */
  liveVersion: number;
  lastEventId: number;
  /** When the vehicles' part was last heard of, page clock in milliseconds; ages grow from here. */
  vehiclesAt: number;
  /** The same for the mission's state and progress. */
  progressAt: number;
  /** By how much the service's clock is ahead of the page's; within two seconds they count as the same. */
  clockAhead_ms: number;
}

export const EMPTY_VIEW: LiveView = {
  mission: null,
  tracks: {},
  samples: {},
  sampledAt: 0,
  events: [],
  alarms: [],
  taken: null,
  ships: null,
  ownShip: null,
  mapVersion: 0,
  liveVersion: 0,
  lastEventId: 0,
  vehiclesAt: 0,
  progressAt: 0,
  clockAhead_ms: 0,
};

const MOST_TRACK_POINTS = 8000;
const MOST_TAIL_POINTS = 120;
const SAMPLE_PERIOD_MS = 1000;
const MOST_SAMPLES = 3600;
const MOST_EVENTS = 2000;
/** A vehicle that moved less than this adds nothing to its track; about 0.3 m, in degrees of latitude. */
const LEAST_MOVE_DEG = 3e-6;

export function reduce(view: LiveView, message: LiveMessage, at: number): LiveView {
  switch (message.type) {
    case "snapshot":
      return {
        mission: message.mission,
        tracks: Object.fromEntries(
          Object.entries(message.tracks).map(([name, old]) => [name, { old, tail: old.slice(-1) }]),
        ),
        samples: view.mission?.id === message.mission.id ? view.samples : {},
        sampledAt: view.sampledAt,
        events: view.mission?.id === message.mission.id ? view.events : [],
        alarms: message.alarms,
        taken: view.mission?.id === message.mission.id ? view.taken : null,
        ships: view.mission?.id === message.mission.id ? view.ships : null,
        ownShip: view.mission?.id === message.mission.id ? view.ownShip : null,
        mapVersion: message.map_version,
        liveVersion: 0,
        lastEventId: message.last_event_id,
        vehiclesAt: at,
        progressAt: at,
        clockAhead_ms: view.clockAhead_ms,
      };
    case "vehicles":
      if (!view.mission) return view;
      return {
        ...view,
        clockAhead_ms: steady(view.clockAhead_ms, Date.parse(message.time) - at),
        mission: { ...view.mission, vehicles: message.vehicles, current: message.current },
        tracks: extendTracks(view.tracks, message.vehicles),
        vehiclesAt: at,
        // A clock that is set back leaves no gap.
        ...(Math.abs(at - view.sampledAt) >= SAMPLE_PERIOD_MS
          ? { samples: sampled(view.samples, message.vehicles, Date.parse(message.time)), sampledAt: at }
          : {}),
      };
    case "targets":
      return view.mission ? { ...view, mission: { ...view.mission, targets: message.targets } } : view;
    case "traffic":
      return view.mission ? { ...view, ships: message.ships, ownShip: message.own_ship } : view;
    case "search":
      if (!view.mission) return view;
      return {
        ...view,
        mission: { ...view.mission, progress: { ...view.mission.progress, search: message.search } },
        progressAt: at,
      };
    case "waypoints":
      if (!view.mission) return view;
      return {
        ...view,
        mission: { ...view.mission, waypoints: newest(view.mission.waypoints, message.waypoints) },
      };
    case "mission":
      if (!view.mission) return view;
      return { ...view, mission: withSummary(view.mission, message.mission), progressAt: at };
    case "map":
      return { ...view, mapVersion: message.version, liveVersion: message.live };
    case "event":
      return withEvents(view, [message.event]);
    case "alarm":
      return withAlarm(view, message.alarm);
  }
}

const SAME_CLOCK_MS = 2000;

/** A difference of clocks as it was, unless it is another by more than messages take. */
const steady = (before_ms: number, found_ms: number): number =>
  Math.abs(found_ms - before_ms) > SAME_CLOCK_MS ? found_ms : before_ms;

/** The mission as it was asked for once, until the live view tells more. */
export function withMission(view: LiveView, mission: MissionView, at: number): LiveView {
  return { ...view, mission, vehiclesAt: at, progressAt: at };
}

/** An alarm as it is now: an open one is shown once, one that was acknowledged no more. */
function withAlarm(view: LiveView, alarm: AlarmView): LiveView {
  const others = view.alarms.filter(({ id }) => id !== alarm.id);
  if (alarm.state === "acknowledged") return { ...view, alarms: others, taken: alarm };
  return { ...view, alarms: [...others, alarm].sort((a, b) => a.raised_at.localeCompare(b.raised_at)) };
}

/** Adds lines to the log: each once, in the order of their numbers, at most the newest 2000. */
export function withEvents(view: LiveView, more: readonly EventView[]): LiveView {
  const known = new Map(view.events.map((event) => [event.id, event]));
  for (const event of more) known.set(event.id, event);
  const events = [...known.values()].sort((a, b) => a.id - b.id).slice(-MOST_EVENTS);
  return { ...view, events };
}

/** One waypoint per vehicle, the one of the highest step. */
function newest(old: readonly WaypointView[], changed: readonly WaypointView[]): WaypointView[] {
  const byVehicle = new Map(old.map((waypoint) => [waypoint.vehicle, waypoint]));
  for (const waypoint of changed) {
    const present = byVehicle.get(waypoint.vehicle);
    if (!present || waypoint.step >= present.step) byVehicle.set(waypoint.vehicle, waypoint);
  }
  return [...byVehicle.values()];
}

function extendTracks(tracks: LiveView["tracks"], vehicles: readonly VehicleView[]): LiveView["tracks"] {
  let changed: Record<string, TrackView> | null = null;
  for (const { name, active, lon_deg, lat_deg, depth_m } of vehicles) {
    // Where a vehicle goes that left is no part of the mission's tracks.
    if (!active || lon_deg === null || lat_deg === null) continue;
    const track = tracks[name] ?? { old: [], tail: [] };
    const last = track.tail.at(-1);
    if (last && Math.hypot(last[0] - lon_deg, last[1] - lat_deg) < LEAST_MOVE_DEG) continue;
    changed ??= { ...tracks };
    changed[name] = extended(track, depth_m === null ? [lon_deg, lat_deg] : [lon_deg, lat_deg, depth_m]);
  }
  return changed ?? tracks;
}

function extended({ old, tail }: TrackView, place: Place): TrackView {
  if (tail.length < MOST_TAIL_POINTS) return { old, tail: [...tail, place] };
  return { old: [...thinned(old), ...tail.slice(old.length > 0 ? 1 : 0), place], tail: [place] };
}

/** Drops every other point of the older half once a track is full, so that the shape of the recent part stays. */
function thinned(track: readonly Place[]): readonly Place[] {
  if (track.length < MOST_TRACK_POINTS) return track;
  const half = track.length >> 1;
  return [...track.slice(0, half).filter((_, i) => i % 2 === 0), ...track.slice(half)];
}

function sampled(
  samples: LiveView["samples"],
  vehicles: readonly VehicleView[],
  at: number,
): LiveView["samples"] {
  const next = { ...samples };
  for (const { name, active, depth_m, altitude_m, battery_pct, age_s } of vehicles) {
    if (!active) continue;
    next[name] = [
      ...(samples[name] ?? []).slice(1 - MOST_SAMPLES),
      { at, depth_m, altitude_m, battery_pct, age_s },
    ];
  }
  return next;
}

/** Seconds since a vehicle was last heard, counted on since the service said so; null: never. */
export function ageSeconds(vehicle: VehicleView, vehiclesAt: number, now: number): number | null {
  return vehicle.age_s === null ? null : vehicle.age_s + Math.max(0, now - vehiclesAt) / 1000;
}

/** What follows the shown mission and has begun, or is about to: where that one was flown to its end, not ended by a person. */
export function nextOf(
  { mission, events }: Pick<LiveView, "mission" | "events">,
  list: readonly Pick<MissionSummary, "id" | "after" | "state">[],
): string | null {
  const ended = events.findLast(({ kind, data }) => kind === "state" && data.state === "finished");
  if (mission?.state !== "finished" || ended?.data.actor !== "service") return null;
  const next = list.find(
    ({ after, state }) => after === mission.id && (state === "ready" || state === "running"),
  );
  return next?.id ?? null;
}

/** Whether no step is to come; one of a mission that is not counted in steps is, while there is something left to fly. */
export function allDecided({ budget, step, steps, minutes_left, km_left_per_vehicle }: Decided): boolean {
  return budget.steps != null ? step >= steps : minutes_left === 0 || km_left_per_vehicle === 0;
}

/** What becomes of a waypoint in the end. */
export const SETTLED = ["reached", "missed", "refused"];

/** Whether all that survey wait for a decision; who is held or called home waits for none. */
export function allWait(vehicles: readonly Waiting[]): boolean {
  const team = vehicles.filter(({ view }) => view.active && view.link === "engaged" && view.withdrawn === "");
  return team.length > 0 && team.every(({ waypoint }) => !waypoint || SETTLED.includes(waypoint.status));
}

interface Waiting {
  view: Pick<VehicleView, "active" | "link" | "withdrawn">;
  waypoint: Pick<WaypointView, "status"> | undefined;
}

type Decided = Pick<
  MissionView["progress"],
  "budget" | "step" | "steps" | "minutes_left" | "km_left_per_vehicle"
>;

/** A mission as it is told of now; how long it is may have changed since it was described. */
function withSummary(mission: MissionView, told: MissionSummary): MissionView {
  const { budget, steps } = told.progress;
  const same = JSON.stringify(budget) === JSON.stringify(mission.progress.budget);
  return { ...mission, ...told, spec: same ? mission.spec : { ...mission.spec, budget, steps } };
}
