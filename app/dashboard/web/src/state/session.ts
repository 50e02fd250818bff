/** What goes on while the page is open: asking for lists, following one mission, sending commands. */

import { effect, signal } from "@preact/signals";
import { api, liveUrl, ServiceError, token } from "../api/client";
import { LiveSocket } from "../api/socket";
import type { ActionView, MissionAction, NewMission } from "../api/types";
import { EMPTY_VIEW, reduce, withEvents } from "./live";
import { fleet, missions, now, seaFloor, selectedId, serviceFault, socketStatus, view } from "./store";

const LIST_PERIOD_MS = 5000;
const LEAST_MAP_PERIOD_MS = 700;

/** The last command that was refused, until it is dismissed or the next one succeeds. */
export const refusal = signal<{ what: string; error: ServiceError } | null>(null);
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
  effect(() => {
    const id = selectedId.value;
    return id ? followMission(id) : clear();
  });
}

export function selectMission(id: string): void {
  location.hash = `#/missions/${encodeURIComponent(id)}`;
}

async function refreshForever(): Promise<never> {
  for (;;) {
    await refresh();
    await new Promise((resolve) => setTimeout(resolve, LIST_PERIOD_MS));
  }
}

export async function refresh(): Promise<void> {
  try {
    const [list, vehicles] = await Promise.all([api.missions(), api.vehicles()]);
    missions.value = list;
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

function noteFault(error: unknown): void {
  if (!(error instanceof ServiceError)) throw error;
  serviceFault.value = error;
}

/** Uses another access token from now on, and asks for everything again. */
export function signIn(text: string): void {
  token.value = text.trim();
  location.reload();
}

function clear(): void {
  view.value = EMPTY_VIEW;
  seaFloor.value = null;
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
  const socket = new LiveSocket(liveUrl(id), {
    onStatus: (status) => {
      socketStatus.value = status;
    },
    onMessage: (message) => {
      view.value = reduce(view.peek(), message, Date.now());
      if (message.type === "snapshot") catchUp(message.last_event_id).catch(noteFault);
    },
  });
  const stopMap = followMap(id);
  return () => {
    closed = true;
    socket.close();
    stopMap();
  };
}

/** Fetches the newest map whenever there is a newer one, one request at a time. */
function followMap(id: string): () => void {
  let stopped = false;
  let fetching = false;
  const stop = effect(() => {
    const wanted = view.value.mapVersion;
    if (!fetching && wanted > 0 && wanted !== seaFloor.peek()?.version) {
      fetching = true;
      void fetchMap();
    }
  });
  async function fetchMap(): Promise<void> {
    while (!stopped && view.peek().mapVersion !== seaFloor.peek()?.version) {
      try {
        const map = await api.map(id);
        if (stopped) return;
        seaFloor.value = map;
      } catch {
        // The live socket tells of a service that is gone; the next round asks again.
      }
      await new Promise((resolve) => setTimeout(resolve, LEAST_MAP_PERIOD_MS));
    }
    fetching = false;
  }
  return () => {
    stopped = true;
    stop();
  };
}

/** Sends a command for the selected mission. Returns the service's answer, or null when it was refused. */
export async function act(action: MissionAction): Promise<ActionView | null> {
  const id = selectedId.value;
  if (!id) return null;
  busyWith.value = action;
  try {
    const answer = await api.act(id, action);
    refusal.value = null;
    void refresh();
    return answer;
  } catch (error) {
    if (!(error instanceof ServiceError)) throw error;
    refusal.value = { what: action, error };
    return null;
  } finally {
    busyWith.value = null;
  }
}

export async function createMission(mission: NewMission): Promise<void> {
  const created = await api.create(mission);
  await refresh();
  selectMission(created.id);
}
