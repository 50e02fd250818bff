/** Replaying a mission: its ways are fetched once, then every step is a matter of looking it up. */

import { computed, effect, signal } from "@preact/signals";
import { api } from "../../api/client";
import type { LngLat, WaypointView } from "../../api/types";
import { fetchSteps, noteFault } from "../session";
import { colourOf, replayStep, selectedId, steps } from "../store";
import { endsOf, placeAt, type Way, waysOf } from "./history";

const ways = signal<Readonly<Record<string, Way>>>({});
export const playing = signal(false);
/** Steps per second. */
export const pace = signal(4);

export interface Replayed {
  vehicle: string;
  colour: string;
  place: LngLat;
  depth_m: number | null;
  waypoint: WaypointView | undefined;
  /** Its way until then. */
  track: readonly LngLat[];
  depths_m: readonly number[];
}

const ends = computed(() =>
  Object.fromEntries(Object.entries(ways.value).map(([name, way]) => [name, endsOf(name, way, steps.value)])),
);

/** The vehicles at the step that is replayed; null when the present is shown. */
export const replayed = computed<Replayed[] | null>(() => {
  const number = replayStep.value;
  if (number === null) return null;
  const index = steps.value.findIndex((s) => s.number === number);
  const step = steps.value[index];
  if (!step) return [];
  const names = new Set([...Object.keys(ways.value), ...step.waypoints.map((w) => w.vehicle)]);
  return [...names].flatMap((vehicle) => {
    const way = ways.value[vehicle];
    const at = placeAt(vehicle, way, ends.value[vehicle] ?? [], index, step);
    if (!at) return [];
    const end = ends.value[vehicle]?.[index] ?? 0;
    const colour = colourOf.value.get(vehicle) ?? "#888888";
    const track = way?.places.slice(0, end) ?? [];
    return [{ vehicle, colour, ...at, track, depths_m: way?.depths_m.slice(0, end) ?? [] }];
  });
});

/** The step that is replayed; undefined while the present is shown. */
export const shownStep = computed(() => steps.value.find((s) => s.number === replayStep.value));

/** Seconds from the first step to the one that is replayed, pauses included. */
export const elapsedThen = computed(() => {
  const [first, then] = [steps.value[0], shownStep.value];
  return first && then ? (Date.parse(then.committed_at) - Date.parse(first.committed_at)) / 1000 : null;
});

/** The step that is shown as soon as what is needed of the past has come; null: none is waited for. */
export const awaited = signal<number | null>(null);
/** One at a time: a slider that is moved asks for many steps, and whole ways are long. */
let fetching: { id: string; done: Promise<void> } | null = null;

async function fetchPast(id: string): Promise<void> {
  const [tracks] = await Promise.all([api.tracks(id), fetchSteps(true)]);
  if (selectedId.peek() === id) ways.value = waysOf(tracks);
}

/** Shows a step of the past, the one that was asked for last; asks for what is needed the first time. */
export async function replay(step: number): Promise<void> {
  const id = selectedId.peek();
  if (!id) return;
  awaited.value = step;
  try {
    // The mission may have gone on since the past was asked for.
    if (replayStep.peek() === null || step > (steps.peek().at(-1)?.number ?? 0)) {
      if (fetching?.id !== id) fetching = { id, done: fetchPast(id) };
      const mine = fetching;
      await mine.done.finally(() => {
        if (fetching === mine) fetching = null;
      });
    }
    if (selectedId.peek() === id && awaited.peek() === step) replayStep.value = step;
  } catch (error) {
    noteFault(error);
  } finally {
    if (selectedId.peek() === id && awaited.peek() === step) awaited.value = null;
  }
}

export function showPresent(): void {
  awaited.value = null;
  playing.value = false;
  replayStep.value = null;
}

effect(() => {
  if (!playing.value) return;
  const timer = setInterval(() => {
    const last = steps.peek().at(-1)?.number ?? 0;
    const here = replayStep.peek();
    if (here === null || here >= last) playing.value = false;
    else replayStep.value = here + 1;
  }, 1000 / pace.value);
  return () => clearInterval(timer);
});

effect(() => {
  selectedId.value;
  ways.value = {};
  playing.value = false;
  awaited.value = null;
});
