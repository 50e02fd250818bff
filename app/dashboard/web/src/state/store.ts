/** The page's state: signals that the components and the map read. */

import { computed, signal } from "@preact/signals";
import type { ServiceError } from "../api/client";
import type { SocketStatus } from "../api/socket";
import type {
  LngLat,
  MapView,
  MissionSummary,
  PolygonGeometry,
  VehicleView,
  WaypointView,
} from "../api/types";
import { kept } from "../kept";
import { fittingRange, type Layer, type Range } from "../map/bathymetry";
import { vehicleColour } from "../map/palette";
import { ageSeconds, EMPTY_VIEW, type LiveView } from "./live";

/** null until the first answer. */
export const missions = signal<readonly MissionSummary[] | null>(null);
export const fleet = signal<readonly VehicleView[]>([]);
/** What went wrong when the service was last asked for its lists; null when all is well. */
export const serviceFault = signal<ServiceError | null>(null);

export const selectedId = signal<string | null>(null);
export const view = signal<LiveView>(EMPTY_VIEW);
export const seaFloor = signal<MapView | null>(null);
export const socketStatus = signal<SocketStatus | null>(null);
/** Page clock, milliseconds, ticking. */
export const now = signal(Date.now());

export const mission = computed(() => view.value.mission);
export const waypointOf = computed(
  () => new Map<string, WaypointView>((mission.value?.waypoints ?? []).map((w) => [w.vehicle, w])),
);

/** Colours follow the order in which vehicles joined, so that they stay when one leaves. */
export const colourOf = computed(() => {
  const names = new Set([
    ...(mission.value?.spec.vehicles ?? []).map((v) => v.name),
    ...(mission.value?.vehicles ?? []).map((v) => v.name),
  ]);
  return new Map([...names].map((name, index) => [name, vehicleColour(index)]));
});

/** After this long without a word a vehicle's values are drawn as old. */
export const STALE_AFTER_S = 5;

export interface Vehicle {
  view: VehicleView;
  waypoint: WaypointView | undefined;
  colour: string;
  age_s: number | null;
  stale: boolean;
}

export const vehicles = computed<Vehicle[]>(() =>
  (mission.value?.vehicles ?? []).map((v) => {
    const age_s = ageSeconds(v, view.value.vehiclesAt, now.value);
    return {
      view: v,
      waypoint: waypointOf.value.get(v.name),
      colour: colourOf.value.get(v.name) ?? "#888888",
      age_s,
      stale: age_s === null || age_s > STALE_AFTER_S,
    };
  }),
);

/** Alarms that nobody has taken yet, newest first. */
export const takenAlarms = kept<Record<string, number>>("taken-alarms", {});
export const openAlarms = computed(() => {
  const id = mission.value?.id;
  if (!id) return [];
  const taken = takenAlarms.value[id] ?? 0;
  return view.value.events.filter((e) => e.level === "alarm" && e.id > taken).reverse();
});

export function takeAlarms(): void {
  const newest = openAlarms.value[0];
  if (newest) takenAlarms.value = { ...takenAlarms.value, [newest.mission_id]: newest.id };
}

export type Theme = "system" | "light" | "dark";
export const theme = kept<Theme>("theme", "system");
const systemDark = signal(matchMedia("(prefers-color-scheme: dark)").matches);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (e) => {
  systemDark.value = e.matches;
});
export const isDark = computed(() => (theme.value === "system" ? systemDark.value : theme.value === "dark"));

export const layer = signal<Layer>("depth");
export const showHatching = kept("hatching", true);
/** Ranges that the operator fixed, for each layer; a layer without one takes a fitting range. */
export const fixedRanges = kept<Partial<Record<Layer, Range>>>("ranges", {});
export const shownRange = computed<Range | null>(() => {
  const fixed = fixedRanges.value[layer.value];
  if (fixed) return fixed;
  return seaFloor.value ? fittingRange(seaFloor.value, layer.value) : null;
});

/** The area of a mission being described, and where the cursor is on the map. */
export const draftArea = signal<PolygonGeometry | null>(null);
export const cursor = signal<LngLat | null>(null);
export const mapCentre = signal<LngLat>([-8.7044, 41.1854]);

export const panelOpen = signal(matchMedia("(min-width: 1180px)").matches);
export const describing = signal(false);
export const abortDialogOpen = signal(false);

/** Whether the link doctor is shown. */
export const linksOpen = signal(false);
export const logOpen = signal(false);
export const filesOpen = signal(false);
