/** Beams of swath sonars as points, and what an operator says of those that are chosen. */

import { signal } from "@preact/signals";
import { api } from "../../api/client";
import type { BeamPoints, BeamSelection, LngLat, NamedBeams, SoundingState } from "../../api/types";
import { type Cloud, chosenPoints, cloud, type Ruling, ruled } from "./cloud";

/** What of the survey is shown; null: all of it. */
export const beamArea = signal<BeamSelection["area"]>(null);
/** The beams that are shown; null: none are asked for. */
export const beams = signal<BeamPoints | null>(null);
/** Numbers of the edits that were made here, the last of which can be taken back. */
export const doneEdits = signal<readonly number[]>([]);

/** Degrees by which ground reaches beyond the beams that frame it: they lie on it, too. */
const MARGIN_DEG = 1e-6;

/** Beams as points in space. */
export const beamCloud = (found: BeamPoints): Cloud => ({
  id: found.beam.map((_, k) => k),
  lng: found.lon_deg,
  lat: found.lat_deg,
  depth_m: found.depth_m,
  state: found.state.map((k) => found.states[k] as SoundingState),
  total: found.total,
});

/** Ground round some of the points: what lies on it is asked for without leaving out pings. */
export function groundRound(found: BeamPoints, chosen: readonly number[]): BeamSelection["area"] {
  if (chosen.length === 0) return null;
  const range = (values: readonly number[]): [number, number] => {
    const those = chosen.map((k) => values[k] as number);
    return [
      those.reduce((a, b) => Math.min(a, b)) - MARGIN_DEG,
      those.reduce((a, b) => Math.max(a, b)) + MARGIN_DEG,
    ];
  };
  const [west, east] = range(found.lon_deg);
  const [south, north] = range(found.lat_deg);
  const ring: LngLat[] = [
    [west, south],
    [east, south],
    [east, north],
    [west, north],
    [west, south],
  ];
  return { type: "Polygon", coordinates: [ring.map(([lng, lat]): [number, number] => [lng, lat])] };
}

/** Names the chosen points, ping by ping. */
export function namedBeams(found: BeamPoints, chosen: readonly number[]): NamedBeams[] {
  const pings = new Map<number, number[]>();
  for (const k of chosen) {
    const ping = found.ping[k] as number;
    const own = pings.get(ping);
    if (own) own.push(found.beam[k] as number);
    else pings.set(ping, [found.beam[k] as number]);
  }
  return [...pings].map(([ping, places]) => ({
    vehicle: found.vehicles[found.vehicle[ping] as number] as string,
    time_s: found.time_s[ping] as number,
    beams: places,
  }));
}

/** Reads the beams of the survey, or of the ground that is looked at. */
export async function loadBeams(mission: string, gone: AbortSignal): Promise<void> {
  const area = beamArea.peek();
  const found = await api.beamPoints(mission, area ? { area } : {}, gone);
  if (gone.aborted) return;
  beams.value = found;
  chosenPoints.value = [];
  cloud.value = beamCloud(found);
}

export function forgetBeams(): void {
  beams.value = null;
  beamArea.value = null;
  doneEdits.value = [];
}

/** Rejects or restores the chosen beams. */
export async function ruleChosenBeams(mission: string, ruling: Ruling, note: string): Promise<void> {
  const [found, chosen, shown] = [beams.value, chosenPoints.value, cloud.value];
  if (!found || !shown || chosen.length === 0) return;
  const edit = await api.ruleBeams(mission, ruling, { pings: namedBeams(found, chosen) }, note);
  doneEdits.value = [...doneEdits.value, edit.id];
  cloud.value = ruled(shown, chosen, ruling);
  chosenPoints.value = [];
}

/** Takes back the last edit that was made here. */
export async function takeBackEdit(mission: string, gone: AbortSignal): Promise<void> {
  const last = doneEdits.value.at(-1);
  if (last === undefined) return;
  await api.withdrawBeamEdit(mission, last);
  doneEdits.value = doneEdits.value.slice(0, -1);
  await loadBeams(mission, gone);
}
