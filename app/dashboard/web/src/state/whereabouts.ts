/** Where a vehicle was when something happened, shown on the map. */

import { api } from "../api/client";
import type { EventView, LngLat, StepView } from "../api/types";
import { endsOf, placeAt, type Way, waysOf } from "./history";
import { fetchSteps, noteFault } from "./session";
import { destination, marked, mission, selectedId, steps } from "./store";

/** As much about a place as is shown of it, degrees. */
const ABOUT_DEG = 0.0006;
/** What happened so lately happened where its vehicle is now. */
const LATELY_MS = 15_000;

/** Which step was flown at a moment: the last one that was committed by then; -1 before the first. */
export function stepAt(known: readonly StepView[], at: number): number {
  let found = -1;
  for (const [i, step] of known.entries()) if (Date.parse(step.committed_at) <= at) found = i;
  return found;
}

/** The vehicle that a line of the log is about; null where it is about none. */
export function vehicleOf({ data }: Pick<EventView, "data">): string | null {
  return typeof data.vehicle === "string" ? data.vehicle : null;
}

/** Where a vehicle was at a moment, as its way and the steps tell; null where nobody knows. */
export function placeThen(
  vehicle: string,
  way: Way | undefined,
  known: readonly StepView[],
  at: number,
): LngLat | null {
  const index = stepAt(known, at);
  const step = known[index];
  if (!step) return way?.places[0] ?? null;
  return placeAt(vehicle, way, way ? endsOf(vehicle, way, known) : [], index, step)?.place ?? null;
}

function show(place: LngLat | null): void {
  if (!place) return;
  marked.value = place;
  const [lng, lat] = place;
  destination.value = [lng - ABOUT_DEG, lat - ABOUT_DEG, lng + ABOUT_DEG, lat + ABOUT_DEG];
}

/** Shows where a vehicle was at a moment; null, or lately: where it is. */
export async function showWhere(vehicle: string, at: number | null): Promise<void> {
  const id = selectedId.peek();
  if (!id) return;
  const present = mission.peek()?.vehicles.find(({ name }) => name === vehicle);
  const here: LngLat | null =
    present?.lon_deg != null && present.lat_deg != null ? [present.lon_deg, present.lat_deg] : null;
  if (at === null || Date.now() - at < LATELY_MS) {
    show(here);
    return;
  }
  try {
    const [tracks] = await Promise.all([api.tracks(id), fetchSteps()]);
    if (selectedId.peek() === id) show(placeThen(vehicle, waysOf(tracks)[vehicle], steps.peek(), at) ?? here);
  } catch (error) {
    noteFault(error);
  }
}

/** Shows where the vehicle of a line of the log was when it was written. */
export async function showEvent(event: EventView): Promise<void> {
  const { lat_deg, lon_deg } = event.data;
  const vehicle = vehicleOf(event);
  if (typeof lat_deg === "number" && typeof lon_deg === "number") show([lon_deg, lat_deg]);
  else if (vehicle) await showWhere(vehicle, Date.parse(event.time));
}
