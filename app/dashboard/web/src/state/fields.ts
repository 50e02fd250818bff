/** The form's fields for plain values of a mission, declared once; type, bounds, default and help are the service's. Pure. */

import SPEC from "../api/mission.json";
import type { NewMission, Sensor } from "../api/types";

export type MissionKind = NonNullable<NewMission["kind"]>;

/** What the service says of a value; `inSearch` is the default of searches that is another one. */
export interface Schema {
  type: string;
  description?: string;
  minimum?: number;
  exclusiveMinimum?: number;
  maximum?: number;
  exclusiveMaximum?: number;
  enum?: readonly string[];
  default?: unknown;
  example?: number;
  inSearch?: unknown;
  nullable?: boolean;
  /** What each order of S-44 asks for. */
  orders?: Readonly<Record<string, number>>;
}

export interface Field {
  /** Where the value stands in a mission. */
  path: keyof typeof SPEC;
  /** Where it stands in the form. */
  part: "quality" | "length" | "limits" | "search" | "tide" | "recovery" | "coverage" | "uncertainty";
  label: string;
  unit?: string;
  placeholder?: string;
  /** Only of this kind of mission. */
  kind?: MissionKind;
  /** May stay empty, and does at first. */
  optional?: true;
  /** How many of the service's units one of the form's is. */
  factor?: number;
}

export const FIELDS = {
  steps: { path: "budget.steps", part: "length", label: "Steps", kind: "survey" },
  minutes: { path: "budget.minutes", part: "length", label: "Minutes", kind: "survey" },
  km_per_vehicle: {
    path: "budget.km_per_vehicle",
    part: "length",
    label: "Km per vehicle",
    kind: "survey",
  },
  goal_radius_m: {
    path: "search.goal_radius_m",
    part: "search",
    label: "Radius of the goal",
    unit: "m",
    kind: "search",
  },
  window_min: {
    path: "search.window_s",
    part: "search",
    label: "Back within",
    unit: "min",
    kind: "search",
    factor: 60,
  },
  safety_m: { path: "search.safety_m", part: "search", label: "From obstacles", unit: "m", kind: "search" },
  reach_m: {
    path: "search.scanner.reach_m",
    part: "search",
    label: "Scanner reaches",
    unit: "m",
    kind: "search",
  },
  max_step_m: { path: "limits.max_step_m", part: "limits", label: "Largest step", unit: "m" },
  speed_mps: { path: "speed_mps", part: "limits", label: "Speed", unit: "m/s" },
  min_depth_m: { path: "limits.min_depth_m", part: "limits", label: "Shallowest", unit: "m", kind: "survey" },
  max_depth_m: { path: "limits.max_depth_m", part: "limits", label: "Deepest", unit: "m" },
  min_altitude_m: { path: "limits.min_altitude_m", part: "limits", label: "Altitude", unit: "m" },
  min_separation_m: { path: "limits.min_separation_m", part: "limits", label: "Apart", unit: "m" },
  com_range_m: {
    path: "limits.com_range_m",
    part: "limits",
    label: "Com. range",
    unit: "m",
    placeholder: "unlimited",
    optional: true,
  },
  cell_m: { path: "cell_m", part: "limits", label: "Cell", unit: "m" },
  cell_of_depth: {
    path: "coverage.cell_of_depth",
    part: "limits",
    label: "Cell by depth",
    kind: "survey",
    placeholder: "one size",
    optional: true,
  },
  accuracy_m: { path: "accuracy_m", part: "quality", label: "Accuracy", unit: "m" },
  shoal_depth_m: {
    path: "shoal_depth_m",
    part: "quality",
    label: "Shoal above",
    unit: "m",
    kind: "survey",
    placeholder: "no layer",
    optional: true,
  },
  overlap_pct: {
    path: "coverage.overlap_pct",
    part: "coverage",
    label: "Overlap of swaths",
    unit: "%",
    kind: "survey",
  },
  crosslines_pct: {
    path: "coverage.crosslines_pct",
    part: "coverage",
    label: "Crosslines",
    unit: "%",
    kind: "survey",
  },
  tide_m: {
    path: "tide.level_m",
    part: "tide",
    label: "Level",
    unit: "m",
    placeholder: "none",
    optional: true,
  },
  sd_range_m: { path: "uncertainty.range_m", part: "uncertainty", label: "Range", unit: "m", kind: "survey" },
  sd_range_pct: {
    path: "uncertainty.range_pct",
    part: "uncertainty",
    label: "Range, by length",
    unit: "%",
    kind: "survey",
  },
  sd_beam_angle_deg: {
    path: "uncertainty.beam_angle_deg",
    part: "uncertainty",
    label: "Beam angle",
    unit: "°",
    kind: "survey",
  },
  sd_roll_deg: {
    path: "uncertainty.roll_deg",
    part: "uncertainty",
    label: "Roll",
    unit: "°",
    kind: "survey",
  },
  sd_pitch_deg: {
    path: "uncertainty.pitch_deg",
    part: "uncertainty",
    label: "Pitch",
    unit: "°",
    kind: "survey",
  },
  sd_heading_deg: {
    path: "uncertainty.heading_deg",
    part: "uncertainty",
    label: "Heading",
    unit: "°",
    kind: "survey",
  },
  sd_roll_patch_deg: {
    path: "uncertainty.roll_patch_deg",
    part: "uncertainty",
    label: "Roll of the mounting",
    unit: "°",
    kind: "survey",
  },
  sd_heave_m: { path: "uncertainty.heave_m", part: "uncertainty", label: "Heave", unit: "m", kind: "survey" },
  sd_waterline_m: {
    path: "uncertainty.waterline_m",
    part: "uncertainty",
    label: "Waterline",
    unit: "m",
    kind: "survey",
  },
  sd_surface_sound_speed_mps: {
    path: "uncertainty.surface_sound_speed_mps",
    part: "uncertainty",
    label: "Sound speed at the sonar",
    unit: "m/s",
    kind: "survey",
  },
  sd_sound_speed_profile_mps: {
    path: "uncertainty.sound_speed_profile_mps",
    part: "uncertainty",
    label: "Sound speed profile",
    unit: "m/s",
    kind: "survey",
  },
  sd_position_m: {
    path: "uncertainty.position_m",
    part: "uncertainty",
    label: "Position",
    unit: "m",
    kind: "survey",
  },
  recovery_radius_m: { path: "recovery.radius_m", part: "recovery", label: "Radius", unit: "m" },
  on_finish: { path: "recovery.on_finish", part: "recovery", label: "On finish" },
  on_low_energy: { path: "recovery.on_low_energy", part: "recovery", label: "On low energy" },
  on_lost_link: { path: "recovery.on_lost_link", part: "recovery", label: "On a lost link" },
} as const satisfies Record<string, Field>;

/** The numbers that a single vehicle may have of its own. */
export const VEHICLE_FIELDS = {
  speed_mps: { path: "vehicles.speed_mps", label: "Speed", unit: "m/s", kind: "survey" },
  altitude_m: { path: "vehicles.altitude_m", label: "Height above bottom", unit: "m", kind: "survey" },
  endurance_min: { path: "vehicles.endurance_min", label: "Endurance", unit: "min" },
  aperture_deg: { path: "vehicles.sonar.aperture_deg", label: "Aperture", unit: "°", sensor: "multibeam" },
  beams: { path: "vehicles.sonar.beams", label: "Beams", sensor: "multibeam" },
  rate_hz: { path: "vehicles.sonar.rate_hz", label: "Pings a second", unit: "Hz", sensor: "multibeam" },
  range_m: { path: "vehicles.sonar.range_m", label: "Range", unit: "m", sensor: "multibeam" },
} as const satisfies Record<string, OwnField>;

/** A number of a single vehicle; with a `sensor` it describes that one. */
export type OwnField = Omit<Field, "part"> & { sensor?: Sensor };

export const SENSORS: readonly Sensor[] = SPEC["vehicles.sensor"].enum as Sensor[];

export type VehicleField = keyof typeof VEHICLE_FIELDS;

/** Those that a vehicle with this sensor has in this kind of mission. */
export function vehicleFieldsOf(kind: MissionKind, sensor: Sensor): [VehicleField, OwnField][] {
  const all = Object.entries(VEHICLE_FIELDS) as [VehicleField, OwnField][];
  return all.filter(([, field]) => (field.kind ?? kind) === kind && (field.sensor ?? sensor) === sensor);
}

/** Where a vehicle's number stands in its description. */
export const ownPath = ({ path }: Pick<Field, "path">): string[] => path.split(".").slice(1);

export type FieldName = keyof typeof FIELDS;
/** Units of a mission's length; one of these fields is sent. */
export type LengthUnit = "steps" | "minutes" | "km_per_vehicle";
/** Every field's value as it is typed. */
export type Texts = Record<FieldName, string>;

export const schemaOf = ({ path }: Pick<Field, "path">): Schema => SPEC[path];

/** The fields of a kind of mission whose length is in this unit, or those of them that stand in one part of the form. */
export function fieldsOf(kind: MissionKind, length: LengthUnit, part?: Field["part"]): [FieldName, Field][] {
  const all = Object.entries(FIELDS) as [FieldName, Field][];
  return all.filter(
    ([name, field]) =>
      (field.kind ?? kind) === kind &&
      (part ?? field.part) === field.part &&
      (field.part !== "length" || name === length),
  );
}

/** What a field begins with: what the service takes where nothing is said, or its example. */
export function startOf(field: Field, kind: MissionKind): string {
  const { default: usual, example, inSearch } = schemaOf(field);
  return textOf(field, kind === "search" && inSearch !== undefined ? inSearch : (usual ?? example));
}

/** What all fields begin with. */
export function startTexts(kind: MissionKind): Texts {
  return textsWith((field) => startOf(field, kind));
}

/** A value of a mission as it is typed. */
export function textOf(field: Field, value: unknown): string {
  if (value == null || (field.optional && value === schemaOf(field).default)) return "";
  return String(typeof value === "number" ? value / (field.factor ?? 1) : value);
}

/** The texts of a mission that there is; what it lacks begins as in a new one. */
export function textsOf(mission: unknown, kind: MissionKind): Texts {
  return textsWith((field) => {
    const value = valueAt(mission, field.path.split("."));
    return value === undefined ? startOf(field, kind) : textOf(field, value);
  });
}

function textsWith(text: (field: Field) => string): Texts {
  return Object.fromEntries(Object.entries(FIELDS).map(([name, field]) => [name, text(field)])) as Texts;
}

/** What a typed text stands for in a mission; undefined: nothing, null: no value. */
export function typedValue(field: Field, text: string): unknown {
  const { type, nullable } = schemaOf(field);
  if (text.trim() === "") return nullable ? null : undefined;
  if (type === "boolean") return text === "true";
  return type === "string" ? text : Number(text) * (field.factor ?? 1);
}

export type Tree = { [key: string]: unknown };

/** What stands at a path; undefined where nothing does. */
export const valueAt = (tree: unknown, path: readonly string[]): unknown =>
  path.reduce((part, key) => (part as Tree | null | undefined)?.[key], tree);

/** A mission with the values that were typed. */
export function withTexts(mission: Tree, texts: Texts, kind: MissionKind, length: LengthUnit): Tree {
  return fieldsOf(kind, length).reduce((made, [name, field]) => {
    const value = typedValue(field, texts[name]);
    return value === undefined ? made : put(made, field.path.split("."), value);
  }, mission);
}

export function put(tree: Tree, [key = "", ...rest]: string[], value: unknown): Tree {
  return { ...tree, [key]: rest.length > 0 ? put((tree[key] ?? {}) as Tree, rest, value) : value };
}

/** What is wrong with a typed text; empty when nothing is. */
export function fieldFault(field: Omit<Field, "part">, text: string): string {
  const schema = schemaOf(field);
  const isNumber = schema.type === "number" || schema.type === "integer";
  if (!isNumber || (field.optional && text.trim() === "")) return "";
  return numberFault(field.label, text, schema, field.factor);
}

/** What is wrong with a typed number; bounds are in units of which `factor` make one of the text's. */
export function numberFault(label: string, text: string, schema: Schema, factor = 1): string {
  const value = Number(text);
  if (text.trim() === "" || !Number.isFinite(value)) return `${label} needs a number`;
  if (schema.type === "integer" && !Number.isInteger(value)) return `${label} needs a whole number`;
  return isWithin(value * factor, schema) ? "" : `${label} must be ${boundsIn(schema, factor)}`;
}

export function isWithin(value: number, schema: Schema): boolean {
  const { minimum = -Infinity, exclusiveMinimum = -Infinity } = schema;
  const { maximum = Infinity, exclusiveMaximum = Infinity } = schema;
  return value >= minimum && value > exclusiveMinimum && value <= maximum && value < exclusiveMaximum;
}

function boundsIn(schema: Schema, factor: number): string {
  const { minimum, maximum } = schema;
  if (minimum !== undefined && maximum !== undefined) {
    return `between ${minimum / factor} and ${maximum / factor}`;
  }
  const words = [
    ["at least", minimum],
    ["more than", schema.exclusiveMinimum],
    ["at most", maximum],
    ["less than", schema.exclusiveMaximum],
  ] as const;
  return words
    .flatMap(([how, bound]) => (bound === undefined ? [] : [`${how} ${bound / factor}`]))
    .join(" and ");
}
