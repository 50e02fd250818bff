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

/** Shows a step of the past; asks for what is needed the first time. */
export async function replay(step: number): Promise<void> {
  const id = selectedId.peek();
  if (!id) return;
  try {
    // The mission may have gone on since the past was asked for.
    if (replayStep.peek() === null || step > (steps.peek().at(-1)?.number ?? 0)) {
      const [tracks] = await Promise.all([api.tracks(id), fetchSteps(true)]);
      if (selectedId.peek() === id) ways.value = waysOf(tracks);
    }
    if (selectedId.peek() === id) replayStep.value = step;
  } catch (error) {
    noteFault(error);
  }
}

export function showPresent(): void {
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
});
