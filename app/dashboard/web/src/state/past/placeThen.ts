/** Where a vehicle was when something happened. Pure. */

import type { EventView, LngLat, StepView } from "../../api/types";
import { endsOf, placeAt, type Way } from "./history";

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
