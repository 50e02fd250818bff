/** Where a vehicle was when something happened, shown on the map. */

import { api } from "../../api/client";
import type { EventView, LngLat } from "../../api/types";
import { fetchSteps, noteFault } from "../session";
import { destination, marked, mission, selectedId, serviceNow, steps } from "../store";
import { waysOf } from "./history";
import { placeThen, vehicleOf } from "./placeThen";

/** As much about a place as is shown of it, degrees. */
const ABOUT_DEG = 0.0006;
/** What happened so lately happened where its vehicle is now. */
const LATELY_MS = 15_000;

function show(place: LngLat | null): void {
  if (!place) return;
  marked.value = { at: place };
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
  if (at === null || serviceNow.peek() - at < LATELY_MS) {
    show(here);
    return;
  }
  try {
    const [tracks] = await Promise.all([api.tracks(id), fetchSteps(true)]);
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
