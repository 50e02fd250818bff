/** A mission being described: the form's fields, checked and turned into what the service takes. Pure. */

import type { LngLat, MissionView, NewMission, PlannerOptions, VehicleSpec } from "../api/types";
import { areaFault, polygonOf, ringOf } from "../map/area";
import { rectangle } from "../map/geo";

/** How the area is given: typed as a rectangle, or as a ring that was drawn or came in a file. */
export type AreaSource = "typed" | "drawn";

/** As typed. */
export interface Draft {
  name: string;
  kind: "survey" | "search";
  /** As "latitude, longitude". */
  goal: string;
  entry: string;
  goal_radius_m: string;
  window_min: string;
  safety_m: string;
  reach_m: string;
  obstacles: readonly (readonly LngLat[])[];
  source: AreaSource;
  ring: readonly LngLat[];
  keepOut: readonly (readonly LngLat[])[];
  latitude: string;
  longitude: string;
  east_m: string;
  north_m: string;
  steps: string;
  cell_m: string;
  accuracy_m: string;
  speed_mps: string;
  max_step_m: string;
  min_depth_m: string;
  max_depth_m: string;
  min_altitude_m: string;
  min_separation_m: string;
  com_range_m: string;
  tide_m: string;
  tide_source: string;
  tide_table: string;
  planner: string;
  options: PlannerOptions;
  simulated: string;
  /** Of the simulated vehicles, separated by commas; empty: sim-1, sim-2 and so on. */
  names: string;
  chosen: readonly VehicleSpec[];
  /** What a mission that is copied has and the form does not show. */
  base: Partial<NewMission>;
}

export type Faults = Partial<Record<keyof Draft, string>>;

/** Planners in plain words, the sensible one first. */
export const PLANNER_PRESETS: Readonly<Record<string, { title: string; words: string }>> = {
  cao: {
    title: "Adaptive",
    words: "Begins evenly and goes where the map is least sure. The right choice for nearly every survey.",
  },
  lawnmower: {
    title: "Even lines",
    words:
      "Parallel lines over the whole area, shared among the vehicles. Predictable; finds no more where it is rough.",
  },
  random: { title: "Random", words: "Wanders about. Only to compare the others with." },
};

/** A draft whose area lies in the middle of what the map shows. */
export function emptyDraft(middle: LngLat): Draft {
  const draft: Draft = {
    name: "",
    kind: "survey",
    goal: "",
    entry: "",
    goal_radius_m: "30",
    window_min: "30",
    safety_m: "2",
    reach_m: "12",
    obstacles: [],
    source: "typed",
    ring: [],
    keepOut: [],
    latitude: "",
    longitude: "",
    east_m: "100",
    north_m: "100",
    steps: "100",
    cell_m: "1",
    accuracy_m: "0.25",
    speed_mps: "1",
    max_step_m: "10",
    min_depth_m: "2",
    max_depth_m: "30",
    min_altitude_m: "1",
    min_separation_m: "5",
    com_range_m: "",
    tide_m: "",
    tide_source: "",
    tide_table: "",
    planner: "cao",
    options: {},
    simulated: "2",
    names: "",
    chosen: [],
    base: {},
  };
  return { ...draft, ...centred(draft, middle) };
}

/** A draft of a mission like one that there is, its vehicles as they are described there. */
export function copyOf({ spec, name }: Pick<MissionView, "spec" | "name">): Draft {
  const ring = ringOf(spec.area as NewMission["area"]);
  const { tide, ...base } = spec;
  const { limits, search } = base;
  const text = (value: number | null | undefined) => (value == null ? "" : String(value));
  const goal = search
    ? { goal: typedPlace(search.goal as LngLat), entry: typedPlace(search.entry as LngLat) }
    : {};
  return {
    ...emptyDraft(ring[0] ?? [0, 0]),
    ...goal,
    name: `${name} (copy)`,
    kind: spec.kind,
    ...(search
      ? {
          goal_radius_m: String(search.goal_radius_m),
          window_min: String(search.window_s / 60),
          safety_m: String(search.safety_m),
          reach_m: String(search.scanner.reach_m),
          obstacles: search.obstacles.map((one) => ringOf(one as NewMission["area"])),
        }
      : {}),
    source: "drawn",
    ring,
    keepOut: spec.keep_out.map((zone) => ringOf(zone as NewMission["area"])),
    steps: String(spec.steps),
    cell_m: String(spec.cell_m),
    accuracy_m: String(spec.accuracy_m),
    speed_mps: String(spec.speed_mps),
    max_step_m: String(limits.max_step_m),
    min_depth_m: String(limits.min_depth_m),
    max_depth_m: String(limits.max_depth_m),
    min_altitude_m: String(limits.min_altitude_m),
    min_separation_m: String(limits.min_separation_m),
    com_range_m: text(limits.com_range_m),
    tide_m: tide.level_m === 0 ? "" : String(tide.level_m),
    tide_source: tide.level_m === 0 ? "" : tide.source,
    planner: spec.planner.name,
    options: spec.planner.options as PlannerOptions,
    simulated: "0",
    chosen: spec.vehicles as VehicleSpec[],
    base: base as Partial<NewMission>,
  };
}

/** Names of the simulated vehicles, each another one than those that were chosen have. */
export function simulatedNames(draft: Draft): string[] {
  const given = draft.names.split(",").map((name) => name.trim());
  if (draft.names.trim() !== "") return given.filter((name) => name !== "");
  const taken = new Set(draft.chosen.map((v) => v.name));
  const names: string[] = [];
  for (let n = 1; names.length < Number(draft.simulated); n++) {
    if (!taken.has(`sim-${n}`)) names.push(`sim-${n}`);
  }
  return names;
}

/** Where a typed area begins when a place is to be its middle; nothing while its size is no size. */
export function centred(draft: Draft, [lng, lat]: LngLat): Partial<Draft> {
  const area = areaOf({ ...draft, source: "typed", longitude: String(lng), latitude: String(lat) });
  const northEast = area?.coordinates[0]?.[2];
  if (!northEast) return {};
  return {
    longitude: (lng - (northEast[0] - lng) / 2).toFixed(6),
    latitude: (lat - (northEast[1] - lat) / 2).toFixed(6),
  };
}

interface NumberField {
  field: keyof Draft;
  label: string;
  low: number;
  high: number;
  whole?: boolean;
  /** May stay empty. */
  optional?: boolean;
  typedArea?: boolean;
  /** Only of this kind of mission. */
  kind?: Draft["kind"];
}

const NUMBERS: NumberField[] = [
  { field: "latitude", label: "Latitude", low: -85, high: 85, typedArea: true },
  { field: "longitude", label: "Longitude", low: -180, high: 180, typedArea: true },
  { field: "east_m", label: "Size to the east", low: 2, high: 20_000, typedArea: true },
  { field: "north_m", label: "Size to the north", low: 2, high: 20_000, typedArea: true },
  { field: "goal_radius_m", label: "Radius of the goal area", low: 1, high: 10_000, kind: "search" },
  { field: "window_min", label: "Time window", low: 0.5, high: 10_000, kind: "search" },
  { field: "safety_m", label: "Distance to obstacles", low: 1, high: 100, kind: "search" },
  { field: "reach_m", label: "Reach of the scanner", low: 0.5, high: 200, kind: "search" },
  { field: "steps", label: "Steps", low: 1, high: 100_000, whole: true, kind: "survey" },
  { field: "cell_m", label: "Cell", low: 0.1, high: 1000 },
  { field: "accuracy_m", label: "Accuracy", low: 0.001, high: 100 },
  { field: "speed_mps", label: "Speed", low: 0.1, high: 5 },
  { field: "max_step_m", label: "Largest step", low: 0.1, high: 2000 },
  { field: "min_depth_m", label: "Shallowest travel", low: 0, high: 6000 },
  { field: "max_depth_m", label: "Deepest travel", low: 0.1, high: 6000 },
  { field: "min_altitude_m", label: "Least altitude", low: 0, high: 1000 },
  { field: "min_separation_m", label: "Least distance", low: 0, high: 10_000 },
  { field: "com_range_m", label: "Communication range", low: 1, high: 100_000, optional: true },
  { field: "tide_m", label: "Water level", low: -20, high: 20, optional: true },
  { field: "simulated", label: "Simulated vehicles", low: 0, high: 20, whole: true },
];

/** What is wrong with a draft, field by field, with what would be right. */
export function faultsOf(draft: Draft): Faults {
  const faults: Faults = {};
  if (!draft.name.trim()) faults.name = "Give the mission a name";
  for (const { field, label, low, high, whole, optional, typedArea, kind } of NUMBERS) {
    if ((typedArea && draft.source !== "typed") || (kind && draft.kind !== kind)) continue;
    const text = String(draft[field]).trim();
    const value = Number(text);
    if (text === "" && optional) continue;
    if (text === "" || !Number.isFinite(value)) faults[field] = `${label} needs a number`;
    else if (whole && !Number.isInteger(value)) faults[field] = `${label} needs a whole number`;
    else if (value < low || value > high) faults[field] = `${label} must be between ${low} and ${high}`;
  }
  if (draft.source === "drawn") {
    const fault = areaFault(draft.ring, faults.cell_m ? 0 : Number(draft.cell_m));
    if (fault) faults.ring = draft.ring.length === 0 ? "Draw the area, or read it from a file" : fault;
  }
  draft.keepOut.forEach((zone, i) => {
    const fault = areaFault(zone, 0);
    if (fault) faults.keepOut = `Keep-out zone ${i + 1}: ${fault.toLowerCase()}`;
  });
  if (draft.kind === "search") {
    for (const [field, words] of [
      ["goal", "the goal"],
      ["entry", "the entry"],
    ] as const) {
      if (!placeOf(draft[field])) faults[field] = `Pick ${words} on the map, or type "41.1852, -8.7046"`;
    }
    draft.obstacles.forEach((ring, i) => {
      const fault = areaFault(ring, 0);
      if (fault) faults.obstacles = `Obstacle ${i + 1}: ${fault.toLowerCase()}`;
    });
  }
  if (!faults.max_depth_m && !faults.min_depth_m && Number(draft.max_depth_m) < Number(draft.min_depth_m)) {
    faults.max_depth_m = "Deepest travel must not be above the shallowest";
  }
  if (!faults.simulated) {
    const names = simulatedNames(draft);
    const all = [...draft.chosen.map((v) => v.name), ...names];
    const twice = all.find((name, i) => all.indexOf(name) !== i);
    if (names.length !== Number(draft.simulated))
      faults.names = `${names.length} names for ${draft.simulated} vehicles: one for each, separated by commas`;
    else if (twice !== undefined) faults.names = `Two vehicles are called ${twice || "nothing"}`;
  }
  if (!faults.simulated && Number(draft.simulated) + draft.chosen.length === 0) {
    faults.simulated = "Choose at least one vehicle, or simulate some";
  }
  return faults;
}

/** A place typed as "latitude, longitude" in decimal degrees; null when it is none. */
export function placeOf(text: string): LngLat | null {
  const [lat, lng, ...rest] = text.trim() === "" ? [] : text.split(/[,;\s]+/).map(Number);
  if (lat === undefined || lng === undefined || rest.some((n) => n !== 0)) return null;
  return Math.abs(lat) <= 90 && Math.abs(lng) <= 180 ? [lng, lat] : null;
}

/** A place as it is typed. */
export function typedPlace([lng, lat]: LngLat): string {
  return `${lat.toFixed(6)}, ${lng.toFixed(6)}`;
}

/** The area that a draft describes; null while it describes none. */
export function areaOf(draft: Draft) {
  if (draft.source === "drawn") return draft.ring.length >= 3 ? polygonOf(draft.ring) : null;
  const faults = faultsOf(draft);
  if (faults.latitude || faults.longitude || faults.east_m || faults.north_m) return null;
  return rectangle(
    [Number(draft.longitude), Number(draft.latitude)],
    Number(draft.east_m),
    Number(draft.north_m),
  );
}

/** Corners of a draft's area, typed or drawn. */
export function cornersOf(draft: Draft): LngLat[] {
  const area = areaOf(draft);
  return area ? ringOf(area) : [];
}

/** What to send for a draft without faults. */
export function toMission(draft: Draft): NewMission {
  const area = areaOf(draft);
  if (!area) throw new Error("the draft has faults");
  const simulated = simulatedNames(draft).map((name): VehicleSpec => ({ name, kind: "sim", sensor: "dvl" }));
  const range = draft.com_range_m.trim();
  const tide = draft.tide_m.trim();
  if (draft.kind === "search") return toSearch(draft, area, [...draft.chosen, ...simulated]);
  return {
    ...draft.base,
    name: draft.name.trim(),
    area,
    keep_out: draft.keepOut.map(polygonOf),
    vehicles: [...draft.chosen, ...simulated],
    steps: Number(draft.steps),
    cell_m: Number(draft.cell_m),
    accuracy_m: Number(draft.accuracy_m),
    speed_mps: Number(draft.speed_mps),
    limits: {
      ...draft.base.limits,
      max_step_m: Number(draft.max_step_m),
      min_depth_m: Number(draft.min_depth_m),
      max_depth_m: Number(draft.max_depth_m),
      min_altitude_m: Number(draft.min_altitude_m),
      min_separation_m: Number(draft.min_separation_m),
      ...(range || draft.base.limits ? { com_range_m: range ? Number(range) : null } : {}),
    },
    planner: { name: draft.planner, options: draft.options },
    ...(tide
      ? { tide: { level_m: Number(tide), source: draft.tide_source.trim() || "stated by the operator" } }
      : {}),
  };
}

/** What to send for a search: it takes its own defaults for steps, planner and arrival. */
function toSearch(draft: Draft, area: NewMission["area"], vehicles: VehicleSpec[]): NewMission {
  const [goal, entry] = [placeOf(draft.goal), placeOf(draft.entry)];
  if (!goal || !entry) throw new Error("the draft has faults");
  return {
    ...draft.base,
    name: draft.name.trim(),
    kind: "search",
    area,
    keep_out: draft.keepOut.map(polygonOf),
    vehicles: vehicles.map((vehicle) => (vehicle.kind === "sim" ? { ...vehicle, depth_m: 0 } : vehicle)),
    cell_m: Number(draft.cell_m),
    limits: {
      ...draft.base.limits,
      min_depth_m: 0,
      max_depth_m: Number(draft.max_depth_m),
      min_altitude_m: Math.min(Number(draft.min_altitude_m), 0.5),
      min_separation_m: Number(draft.min_separation_m),
    },
    search: {
      ...draft.base.search,
      goal,
      goal_radius_m: Number(draft.goal_radius_m),
      entry,
      window_s: 60 * Number(draft.window_min),
      safety_m: Number(draft.safety_m),
      scanner: { reach_m: Number(draft.reach_m), resolution_deg: 1 },
      obstacles: draft.obstacles.map(polygonOf),
    },
  };
}

/** How long a mission takes at most, how far its vehicles go, and how far apart lines over the whole area would be. */
export function estimate(
  draft: Draft,
  area_m2: number,
): { seconds: number; metres: number; spacing_m: number } | null {
  const vehicles = Number(draft.simulated) + draft.chosen.length;
  const [steps, step, speed] = [draft.steps, draft.max_step_m, draft.speed_mps].map(Number) as [
    number,
    number,
    number,
  ];
  const metres = vehicles * steps * step;
  if (!(metres > 0) || !(speed > 0)) return null;
  return { seconds: (steps * step) / speed, metres, spacing_m: area_m2 / metres };
}

const FROM_SERVICE: [prefix: string, field: keyof Draft][] = [
  ["limits.max_step_m", "max_step_m"],
  ["limits.min_depth_m", "min_depth_m"],
  ["limits.max_depth_m", "max_depth_m"],
  ["limits.min_altitude_m", "min_altitude_m"],
  ["limits.min_separation_m", "min_separation_m"],
  ["limits.com_range_m", "com_range_m"],
  ["search.goal", "goal"],
  ["search.goal_radius_m", "goal_radius_m"],
  ["search.entry", "entry"],
  ["search.window_s", "window_min"],
  ["search.safety_m", "safety_m"],
  ["search.scanner", "reach_m"],
  ["search.obstacles", "obstacles"],
  ["planner", "planner"],
  ["tide", "tide_m"],
  ["vehicles", "simulated"],
  ["keep_out", "keepOut"],
  ["area", "ring"],
  ["steps", "steps"],
  ["cell_m", "cell_m"],
  ["accuracy_m", "accuracy_m"],
  ["speed_mps", "speed_mps"],
  ["name", "name"],
];

/** Which of the form's fields a field of the service's refusal stands for. */
export function fieldOf(serviceField: string): keyof Draft | null {
  return (
    FROM_SERVICE.find(([prefix]) => serviceField === prefix || serviceField.startsWith(`${prefix}.`))?.[1] ??
    null
  );
}
