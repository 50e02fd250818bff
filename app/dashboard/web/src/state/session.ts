/** What goes on while the page is open: asking for lists, following one mission, sending commands. */

import { effect, type Signal, signal, untracked } from "@preact/signals";
import { api, liveUrl, ServiceError } from "../api/client";
import { LiveSocket } from "../api/socket";
import type { ActionView, MissionAction, MissionView, NewMission } from "../api/types";
import { siteOf } from "../map/marks/site";
import { withTiles } from "../map/picture/seafloor";
import { type Key, say } from "../words/say";
import { identify, me, signedOut, whyNotCommand } from "./access";
import { EMPTY_VIEW, nextOf, reduce, withEvents, withMission } from "./live";
import { lastFlown, withSteps } from "./past/history";
import { isAllowed } from "./stateNames";
import {
  abortDialogOpen,
  abortOne,
  crossovers,
  crossoversWanted,
  fleet,
  furtherLayers,
  holidays,
  layers,
  listedAt,
  mission,
  missions,
  now,
  replayStep,
  seaFloor,
  selectedId,
  serviceFault,
  site,
  socketStatus,
  steps,
  telemetry,
  view,
} from "./store";

const LIST_PERIOD_MS = 5000;
const LEAST_MAP_PERIOD_MS = 300;
const REPLAY_MAP_PERIOD_MS = 120;
/** As many steps come at once. */
const STEPS_PAGE = 1000;

/** The last command that was refused, until it is dismissed or the next one succeeds. */
export const refusal = signal<{ what: string; error: ServiceError; inDialog: boolean } | null>(null);
export const busyWith = signal<MissionAction | null>(null);

const HASH = /^#\/missions\/(.+)$/;

/** Begins everything that runs for as long as the page is open. */
export function startSession(): void {
  const follow = () => {
    const id = HASH.exec(location.hash)?.[1];
    selectedId.value = id ? decodeURIComponent(id) : null;
  };
  follow();
  window.addEventListener("hashchange", follow);
  setInterval(() => {
    now.value = Date.now();
  }, 500);
  void refreshForever();
  let watched = "";
  effect(() => {
    const shown = mission.value;
    if (shown?.state === "running") watched = shown.ending ? "" : shown.id;
    const next = nextOf(view.value, missions.value ?? []);
    // Whoever watches goes on with the vehicles: what stops them is there.
    if (next && shown?.id === watched) untracked(() => selectMission(next));
  });
  effect(() => {
    const id = selectedId.value;
    return id && me.value && !signedOut.value ? followMission(id) : clear();
  });
}

export function selectMission(id: string): void {
  location.hash = `#/missions/${encodeURIComponent(id)}`;
}

async function refreshForever(): Promise<never> {
  for (;;) {
    // Without anybody signed in every request would be refused, and count as one more.
    if (!signedOut.peek()) await refresh();
    await new Promise((resolve) => setTimeout(resolve, LIST_PERIOD_MS));
  }
}

export async function refresh(): Promise<void> {
  try {
    if (!me.peek()) await identify();
    const known = layers.peek();
    const [list, vehicles, declared] = await Promise.all([
      api.missions(),
      api.vehicles(),
      known.length > 0 ? known : api.layers(),
    ]);
    layers.value = declared;
    missions.value = list;
    listedAt.value = Date.now();
    fleet.value = vehicles;
    serviceFault.value = null;
    if (!selectedId.value) {
      const running = list.find((m) => m.state === "running") ?? list.find((m) => m.state === "paused");
      if (running) selectMission(running.id);
    }
  } catch (error) {
    noteFault(error);
  }
}

export function noteFault(error: unknown): void {
  if (!(error instanceof ServiceError)) throw error;
  // Whoever asked without a session may not even say who he is: that is settled by signing in.
  if (error.status === 401 || (error.status === 403 && !me.peek())) signedOut.value = error;
  else serviceFault.value = error;
}

/** What the service said, for the operator. */
export function said(error: unknown): string {
  if (!(error instanceof ServiceError)) return String(error);
  return [error.message, error.remedy].filter(Boolean).join(". ");
}

/** What the service says is wrong with single fields, or with all. */
export function reasonOf(error: unknown): string {
  const faults = error instanceof ServiceError ? error.faults : [];
  return faults.length > 0 ? faults.map(({ message }) => message).join("; ") : said(error);
}

function clear(): void {
  view.value = EMPTY_VIEW;
  seaFloor.value = null;
  site.value = null;
  holidays.value = null;
  crossovers.value = null;
  socketStatus.value = null;
}

function followMission(id: string): () => void {
  clear();
  let closed = false;
  const catchUp = async (last: number) => {
    const known = view.peek().events.at(-1)?.id ?? 0;
    const events = await api.log(id, known, last);
    if (!closed) view.value = withEvents(view.peek(), events);
  };
  // What is there and where is shown before the live view has gathered the whole ways there.
  api
    .mission(id)
    .then((mission) => {
      if (!closed && !view.peek().mission) view.value = withMission(EMPTY_VIEW, mission, Date.now());
    })
    .catch(() => {
      // The live socket tells what is wrong, and tries again.
    });
  const connections = signal(0);
  const socket = new LiveSocket(liveUrl(id), {
    onStatus: (status) => {
      socketStatus.value = status;
      if (status.kind === "refused" && !closed) void refresh();
    },
    onMessage: (message) => {
      view.value = reduce(view.peek(), message, Date.now());
      if (message.type !== "snapshot") return;
      // A service that was started anew counts its maps from one again.
      connections.value += 1;
      catchUp(message.last_event_id).catch(noteFault);
    },
  });
  const stopMap = followMap(id, () => connections.value);
  const stopSite = followSite(id);
  const stopHolidays = followHolidays(id);
  const stopCrossovers = followCrossovers(id);
  return () => {
    closed = true;
    socket.close();
    stopMap();
    stopSite();
    stopHolidays();
    stopCrossovers();
  };
}

/** Fetches what changed in the map whenever something did, one request at a time. */
function followMap(id: string, connections: () => number): () => void {
  let stopped = false;
  let fetching = false;
  let shown = "";
  const wanted = () => {
    const step = replayStep.value;
    const further = furtherLayers.value;
    const { mapVersion, liveVersion } = view.value;
    const has = step !== null || mapVersion > 0 || liveVersion > 0;
    // When the last that counted was taken back there is no other map, and no other version of it.
    const { soundings = 0, pings = 0 } = view.value.mission?.progress ?? {};
    const counts = soundings + pings > 0 ? "" : "-";
    const version = step === null ? `${connections()}.${mapVersion}.${liveVersion}${counts}` : `@${step}`;
    return has ? `${version} ${further.join()}` : "";
  };
  const stop = effect(() => {
    const want = wanted();
    if (want !== shown && want !== "" && !fetching) void fetchMaps();
  });
  async function fetchMaps(): Promise<void> {
    fetching = true;
    for (let want = untracked(wanted); !stopped && want !== shown && want !== ""; want = untracked(wanted)) {
      const step = replayStep.peek();
      try {
        await fetchMap(step);
        shown = want;
      } catch (error) {
        // Nothing was sounded until that step, or nothing counts any more; that the service is gone the socket tells.
        if (error instanceof ServiceError && error.status === 404) {
          seaFloor.value = null;
          shown = want;
        }
      }
      const pause = step === null ? LEAST_MAP_PERIOD_MS : REPLAY_MAP_PERIOD_MS;
      await new Promise((resolve) => setTimeout(resolve, pause));
    }
    fetching = false;
  }
  async function fetchMap(step: number | null): Promise<void> {
    const further = furtherLayers.peek();
    const known = seaFloor.peek();
    const answer = await api.mapTiles(id, known?.tag ?? "", further, step);
    if (stopped) return;
    const map = withTiles(known, answer) ?? withTiles(null, await api.mapTiles(id, "", further, step));
    if (!stopped) seaFloor.value = map;
  }
  return () => {
    stopped = true;
    stop();
  };
}

/** Fetches a search's site whenever scans changed it. */
const followSite = (id: string) =>
  followVersions(
    () => view.value.mission?.progress.search?.version ?? null,
    async () => siteOf(await api.site(id)),
    site,
  );

/** Fetches what swath sonars missed whenever there is a new map. */
const followHolidays = (id: string) =>
  followVersions(
    () => (view.value.mission?.progress.holidays == null ? null : view.value.mapVersion || null),
    () => api.holidays(id),
    holidays,
  );

/** The service reads all soundings to compare lines where they cross. */
const LEAST_COMPARING_PERIOD_MS = 10_000;

/** Compares lines where they cross when there is a new map, unless there is so much that someone has to ask for it. */
const followCrossovers = (id: string) =>
  followVersions(
    () => (crossoversWanted.value === id ? view.value.mapVersion || null : null),
    () => api.crossovers(id),
    crossovers,
    LEAST_COMPARING_PERIOD_MS,
  );

/** Fetches something whenever there is a version of it that is not known, one request at a time. */
function followVersions<T>(
  wanted: () => number | null,
  fetched: () => Promise<T>,
  found: Signal<T | null>,
  period_ms = LEAST_MAP_PERIOD_MS,
): () => void {
  let stopped = false;
  let fetching = false;
  let known: number | null = null;
  const stop = effect(() => {
    const version = wanted();
    if (version !== null && version !== known && !fetching) void fetchAll();
  });
  async function fetchAll(): Promise<void> {
    fetching = true;
    for (let want = untracked(wanted); !stopped && want !== known; want = untracked(wanted)) {
      try {
        const answer = await fetched();
        if (!stopped) found.value = answer;
        known = want;
      } catch {
        // The service is gone, which the live socket tells of.
      }
      await new Promise((resolve) => setTimeout(resolve, period_ms));
    }
    fetching = false;
  }
  return () => {
    stopped = true;
    stop();
  };
}

/** Asks for the steps that are not known yet; `flown`: for those, too, whose waypoints were still to be flown when they were. */
export async function fetchSteps(flown = false): Promise<void> {
  const id = selectedId.peek();
  if (!id) return;
  const known = steps.peek();
  let after = flown ? lastFlown(known) : (known.at(-1)?.number ?? 0);
  for (;;) {
    const more = await api.steps(id, after);
    if (selectedId.peek() !== id || more.length === 0) return;
    steps.value = withSteps(steps.peek(), more);
    if (more.length < STEPS_PAGE) return;
    after = more.at(-1)?.number ?? after;
  }
}

/** Asks what the vehicles told before this page heard of them. */
export async function fetchTelemetry(): Promise<void> {
  const id = selectedId.peek();
  if (!id) return;
  const found = await api.telemetry(id);
  if (selectedId.peek() === id) telemetry.value = found;
}

/** Asks before the selected mission's team, or one vehicle, is stopped; nothing where that may not be. */
export function askAbort(vehicle: string | null): void {
  const present = mission.value;
  if (!present || whyNotCommand.value !== "" || (vehicle === null && !isAllowed("abort", present))) return;
  abortOne.value = vehicle;
  abortDialogOpen.value = true;
}

const ACTION_KEYS = {
  start: "session.start",
  pause: "session.pause",
  resume: "session.resume",
  finish: "finish.finish",
  abort: "abort.abort2",
} as const satisfies Record<MissionAction, Key>;

/** A command, as its refusal names it. */
export const actionWords = (action: MissionAction): string => say(ACTION_KEYS[action]);

/**
 * Sends a command for the selected mission; `home`: whether vehicles go home first when that ends it. Returns the
 * service's answer, or null when it was refused.
 */
export async function act(action: MissionAction, home?: boolean): Promise<ActionView | null> {
  return acting(action, (id) => api.act(id, action, home));
}

/** Starts the selected mission; `confirmed` are the questions of its checklist that somebody has looked at. */
export async function start(confirmed: readonly string[]): Promise<ActionView | null> {
  return acting("start", (id) => api.start(id, confirmed));
}

async function acting(
  action: MissionAction,
  ask: (id: string) => Promise<ActionView>,
): Promise<ActionView | null> {
  const id = selectedId.value;
  if (!id) return null;
  busyWith.value = action;
  try {
    return await send(actionWords(action), ask(id), action === "abort" || action === "finish");
  } finally {
    busyWith.value = null;
  }
}

/** Stops one vehicle of the selected mission and takes it out. */
export async function abortVehicle(name: string): Promise<ActionView | null> {
  const id = selectedId.value;
  return id ? send(say("session.abortOf", { name }), api.abortVehicle(id, name), true) : null;
}

/** Lets a vehicle that left take part again. */
export async function rejoin(name: string): Promise<void> {
  const id = selectedId.value;
  if (id) await send(say("session.takingBack", { name }), api.rejoin(id, name));
}

/** Sends a vehicle home in the middle of the mission. */
export async function returnVehicle(name: string): Promise<void> {
  const id = selectedId.value;
  if (id) await send(say("session.returnOf", { name }), api.returnVehicle(id, name));
}

/** Lets a vehicle wait where it is. */
export async function holdVehicle(name: string): Promise<void> {
  const id = selectedId.value;
  if (id) await send(say("session.holding", { name }), api.holdVehicle(id, name));
}

/** Lets a vehicle survey again that went home or was stopped. */
export async function resumeVehicle(name: string): Promise<void> {
  const id = selectedId.value;
  if (id) await send(say("session.sendingOn", { name }), api.resumeVehicle(id, name));
}

/** Deletes a mission in which nothing was measured. */
export async function deleteMission(id: string): Promise<void> {
  const refused = (await send(say("session.deletingTheMission"), api.deleteMission(id))) === null;
  if (!refused && selectedId.value === id) location.hash = "#/";
  await refresh();
}

/** Takes a vehicle back that left and sends it home: nobody else leads it there. */
export async function bringHome(name: string): Promise<void> {
  const id = selectedId.value;
  if (!id || !(await send(say("session.takingBack", { name }), api.rejoin(id, name)))) return;
  await send(say("session.returnOf", { name }), api.returnVehicle(id, name));
}

/** Awaits an answer; null where the service refused, which is shown. */
export async function send<T>(what: string, answer: Promise<T>, inDialog = false): Promise<T | null> {
  const before = refusal.peek();
  try {
    const found = await answer;
    // What was refused meanwhile is still to be read.
    if (refusal.peek() === before) refusal.value = null;
    void refresh();
    return found;
  } catch (error) {
    if (!(error instanceof ServiceError)) throw error;
    refusal.value = { what, error, inDialog };
    return null;
  }
}

/**
 * Creates missions that follow each other, all or none, also where that is withdrawn, and shows the first; `complete` gives
 * each what its description does not hold. Returns their ids.
 */
export async function createMissions(
  described: readonly NewMission[],
  complete: (id: string) => Promise<unknown> = async () => undefined,
  withdrawn?: AbortSignal,
): Promise<string[]> {
  const ids: string[] = [];
  try {
    for (const mission of described) {
      const created: MissionView = await api.create({ ...mission, after: ids.at(-1) ?? null });
      ids.push(created.id);
      await complete(created.id);
      withdrawn?.throwIfAborted();
    }
  } catch (error) {
    await Promise.allSettled(ids.map(api.deleteMission));
    throw error;
  }
  await refresh();
  selectMission(ids[0] as string);
  return ids;
}

export const createMission = async (mission: NewMission): Promise<string> =>
  (await createMissions([mission]))[0] as string;

/** Replaces what a mission is to do that has not started; it stays where it is in the list. */
export async function describeMission(id: string, mission: NewMission): Promise<void> {
  await api.describe(id, mission);
  await refresh();
  selectMission(id);
}
