/** All soundings of a mission as points, and what an operator says of many of them at once. */

import { signal } from "@preact/signals";
import { api } from "../../api/client";
import type { SoundingPoints, SoundingState } from "../../api/types";

/** Columns of equal length. */
export interface Cloud {
  id: readonly number[];
  lng: readonly number[];
  lat: readonly number[];
  depth_m: readonly number[];
  state: readonly SoundingState[];
  /** How many there are in the mission. */
  total: number;
}

export type Ruling = "restore" | "reject";
/** What was done last, so that it can be taken back. */
interface Done {
  ids: readonly number[];
  ruling: Ruling;
}

/** More than this many are not drawn. */
export const MOST_POINTS = 300_000;
const MOST_AT_ONCE = 20_000;

/** null: they are not asked for. */
export const cloud = signal<Cloud | null>(null);
/** Places in the cloud that are chosen. */
export const chosenPoints = signal<readonly number[]>([]);
export const donePoints = signal<readonly Done[]>([]);
/** How many could not be restored at the last try, and why the first of them. */
export const refusedPoints = signal<{ count: number; reason: string } | null>(null);

export const EMPTY: Cloud = { id: [], lng: [], lat: [], depth_m: [], state: [], total: 0 };

/** A cloud with one page more. */
export const withPage = (before: Cloud, page: SoundingPoints): Cloud => ({
  id: [...before.id, ...page.id],
  lng: [...before.lng, ...page.lon_deg],
  lat: [...before.lat, ...page.lat_deg],
  depth_m: [...before.depth_m, ...page.depth_m],
  state: [...before.state, ...page.state.map((k) => page.states[k] as SoundingState)],
  total: page.total,
});

/** A cloud in which some soundings were decided about. */
export function ruled(before: Cloud, ids: readonly number[], ruling: Ruling): Cloud {
  const changed = new Set(ids);
  const now: SoundingState = ruling === "reject" ? "withdrawn" : "restored";
  return {
    ...before,
    state: before.state.map((state, i) => (changed.has(before.id[i] as number) ? now : state)),
  };
}

/** Reads all soundings, page after page; what is there already is shown meanwhile. */
export async function loadCloud(mission: string, gone: AbortSignal): Promise<void> {
  let found = EMPTY;
  let after: number | null = 0;
  while (after !== null && found.id.length < MOST_POINTS) {
    const page: SoundingPoints = await api.soundingPoints(mission, after, gone);
    if (gone.aborted) return;
    found = withPage(found, page);
    cloud.value = found;
    after = page.next_after;
  }
}

export function forgetCloud(): void {
  cloud.value = null;
  chosenPoints.value = [];
  donePoints.value = [];
  refusedPoints.value = null;
}

async function decide(
  mission: string,
  ids: readonly number[],
  ruling: Ruling,
  note: string,
): Promise<number[]> {
  const changed: number[] = [];
  refusedPoints.value = null;
  for (let first = 0; first < ids.length; first += MOST_AT_ONCE) {
    const answer = await api.ruleMany(mission, ids.slice(first, first + MOST_AT_ONCE), ruling, note);
    changed.push(...answer.changed);
    const [refused] = answer.refused;
    if (refused) {
      const count: number = (refusedPoints.peek()?.count ?? 0) + answer.refused.length;
      refusedPoints.value = { count, reason: refused.reason };
    }
    if (cloud.value) cloud.value = ruled(cloud.value, answer.changed, ruling);
  }
  return changed;
}

/** Rejects or restores what is chosen. */
export async function ruleChosen(mission: string, ruling: Ruling, note: string): Promise<void> {
  const ids = chosenPoints.value.map((i) => cloud.value?.id[i] as number);
  const changed = await decide(mission, ids, ruling, note);
  if (changed.length > 0) donePoints.value = [...donePoints.value, { ids: changed, ruling }];
  chosenPoints.value = [];
}

/** Takes back what was done last. */
export async function takeBack(mission: string, note: string): Promise<void> {
  const last = donePoints.value.at(-1);
  if (!last) return;
  await decide(mission, last.ids, last.ruling === "reject" ? "restore" : "reject", note);
  donePoints.value = donePoints.value.slice(0, -1);
}
