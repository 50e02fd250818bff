/** A mission being described: the form's fields, checked and turned into what the service takes. Pure. */

import type { LngLat, NewMission, VehicleSpec } from "../api/types";
import { rectangle } from "../map/geo";

/** As typed. */
export interface Draft {
  name: string;
  latitude: string;
  longitude: string;
  east_m: string;
  north_m: string;
  steps: string;
  cell_m: string;
  max_step_m: string;
  min_depth_m: string;
  max_depth_m: string;
  planner: string;
  simulated: string;
  chosen: readonly VehicleSpec[];
}

export type Faults = Partial<Record<keyof Draft, string>>;

/** A draft whose area lies in the middle of what the map shows. */
export function emptyDraft(middle: LngLat): Draft {
  const draft: Draft = {
    name: "",
    latitude: "",
    longitude: "",
    east_m: "100",
    north_m: "100",
    steps: "100",
    cell_m: "1",
    max_step_m: "10",
    min_depth_m: "2",
    max_depth_m: "30",
    planner: "cao",
    simulated: "2",
    chosen: [],
  };
  return { ...draft, ...centred(draft, middle) };
}

/** Where a draft's area begins when a place is to be its middle; nothing while its size is no size. */
export function centred(draft: Draft, [lng, lat]: LngLat): Partial<Draft> {
  const area = areaOf({ ...draft, longitude: String(lng), latitude: String(lat) });
  const northEast = area?.coordinates[0]?.[2];
  if (!northEast) return {};
  return {
    longitude: (lng - (northEast[0] - lng) / 2).toFixed(6),
    latitude: (lat - (northEast[1] - lat) / 2).toFixed(6),
  };
}

const NUMBERS: { field: keyof Draft; label: string; low: number; high: number; whole?: boolean }[] = [
  { field: "latitude", label: "Latitude", low: -85, high: 85 },
  { field: "longitude", label: "Longitude", low: -180, high: 180 },
  { field: "east_m", label: "Size to the east", low: 2, high: 20_000 },
  { field: "north_m", label: "Size to the north", low: 2, high: 20_000 },
  { field: "steps", label: "Steps", low: 1, high: 100_000, whole: true },
  { field: "cell_m", label: "Cell", low: 0.1, high: 1000 },
  { field: "max_step_m", label: "Largest step", low: 0.1, high: 2000 },
  { field: "min_depth_m", label: "Shallowest travel", low: 0, high: 6000 },
  { field: "max_depth_m", label: "Deepest travel", low: 0.1, high: 6000 },
  { field: "simulated", label: "Simulated vehicles", low: 0, high: 20, whole: true },
];

/** What is wrong with a draft, field by field, with what would be right. */
export function faultsOf(draft: Draft): Faults {
  const faults: Faults = {};
  if (!draft.name.trim()) faults.name = "Give the mission a name";
  for (const { field, label, low, high, whole } of NUMBERS) {
    const text = String(draft[field]).trim();
    const value = Number(text);
    if (text === "" || !Number.isFinite(value)) faults[field] = `${label} needs a number`;
    else if (whole && !Number.isInteger(value)) faults[field] = `${label} needs a whole number`;
    else if (value < low || value > high) faults[field] = `${label} must be between ${low} and ${high}`;
  }
  if (!faults.max_depth_m && !faults.min_depth_m && Number(draft.max_depth_m) < Number(draft.min_depth_m)) {
    faults.max_depth_m = "Deepest travel must not be above the shallowest";
  }
  if (!faults.simulated && Number(draft.simulated) + draft.chosen.length === 0) {
    faults.simulated = "Choose at least one vehicle, or simulate some";
  }
  return faults;
}

/** The rectangle that a draft describes; null while its numbers make none. */
export function areaOf(draft: Draft) {
  const faults = faultsOf(draft);
  if (faults.latitude || faults.longitude || faults.east_m || faults.north_m) return null;
  return rectangle(
    [Number(draft.longitude), Number(draft.latitude)],
    Number(draft.east_m),
    Number(draft.north_m),
  );
}

/** What to send for a draft without faults. */
export function toMission(draft: Draft): NewMission {
  const area = areaOf(draft);
  if (!area) throw new Error("the draft has faults");
  const taken = new Set(draft.chosen.map((v) => v.name));
  const simulated: VehicleSpec[] = [];
  for (let n = 1; simulated.length < Number(draft.simulated); n++) {
    const name = `sim-${n}`;
    if (!taken.has(name)) simulated.push({ name, kind: "sim", sensor: "dvl" });
  }
  return {
    name: draft.name.trim(),
    area,
    vehicles: [...draft.chosen, ...simulated],
    steps: Number(draft.steps),
    cell_m: Number(draft.cell_m),
    limits: {
      max_step_m: Number(draft.max_step_m),
      min_depth_m: Number(draft.min_depth_m),
      max_depth_m: Number(draft.max_depth_m),
    },
    planner: { name: draft.planner },
  };
}

const FROM_SERVICE: [prefix: string, field: keyof Draft][] = [
  ["limits.max_step_m", "max_step_m"],
  ["limits.min_depth_m", "min_depth_m"],
  ["limits.max_depth_m", "max_depth_m"],
  ["planner", "planner"],
  ["vehicles", "simulated"],
  ["area", "east_m"],
  ["steps", "steps"],
  ["cell_m", "cell_m"],
  ["name", "name"],
];

/** Which of the form's fields a field of the service's refusal stands for. */
export function fieldOf(serviceField: string): keyof Draft | null {
  return (
    FROM_SERVICE.find(([prefix]) => serviceField === prefix || serviceField.startsWith(`${prefix}.`))?.[1] ??
    null
  );
}
