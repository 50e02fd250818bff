/** The form's fields for plain values of a mission, declared once; type, bounds, default and help are the service's. Pure. */

import SPEC from "../../api/mission.json";
import type { NewMission, Sensor } from "../../api/types";
import { say } from "../../words/say";

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
  part:
    | "quality"
    | "length"
    | "limits"
    | "search"
    | "tide"
    | "recovery"
    | "shoals"
    | "coverage"
    | "crosslines"
    | "uncertainty"
    | "planner";
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
  steps: {
    path: "budget.steps",
    part: "length",
    get label() {
      return say("fields.steps");
    },
    kind: "survey",
  },
  minutes: {
    path: "budget.minutes",
    part: "length",
    get label() {
      return say("fields.minutes");
    },
    kind: "survey",
  },
  km_per_vehicle: {
    path: "budget.km_per_vehicle",
    part: "length",
    get label() {
      return say("fields.kmPerVehicle");
    },
    kind: "survey",
  },
  goal_radius_m: {
    path: "search.goal_radius_m",
    part: "search",
    get label() {
      return say("fields.radiusOfTheGoal");
    },
    unit: "m",
    kind: "search",
  },
  window_min: {
    path: "search.window_s",
    part: "search",
    get label() {
      return say("fields.backWithin");
    },
    unit: "min",
    kind: "search",
    factor: 60,
  },
  safety_m: {
    path: "search.safety_m",
    part: "search",
    get label() {
      return say("fields.fromObstacles");
    },
    unit: "m",
    kind: "search",
  },
  reach_m: {
    path: "search.scanner.reach_m",
    part: "search",
    get label() {
      return say("fields.scannerReaches");
    },
    unit: "m",
    kind: "search",
  },
  max_step_m: {
    path: "limits.max_step_m",
    part: "limits",
    get label() {
      return say("fields.largestStep");
    },
    unit: "m",
  },
  speed_mps: {
    path: "speed_mps",
    part: "limits",
    get label() {
      return say("fleet.speed");
    },
    unit: "m/s",
  },
  min_depth_m: {
    path: "limits.min_depth_m",
    part: "limits",
    get label() {
      return say("fields.shallowest");
    },
    unit: "m",
    kind: "survey",
  },
  max_depth_m: {
    path: "limits.max_depth_m",
    part: "limits",
    get label() {
      return say("fields.deepest");
    },
    unit: "m",
  },
  min_altitude_m: {
    path: "limits.min_altitude_m",
    part: "limits",
    get label() {
      return say("charts.altitude");
    },
    unit: "m",
  },
  min_separation_m: {
    path: "limits.min_separation_m",
    part: "limits",
    get label() {
      return say("fields.apart");
    },
    unit: "m",
  },
  com_range_m: {
    path: "limits.com_range_m",
    part: "limits",
    get label() {
      return say("fields.comRange");
    },
    unit: "m",
    get placeholder() {
      return say("fields.unlimited");
    },
    optional: true,
  },
  cell_m: {
    path: "cell_m",
    part: "limits",
    get label() {
      return say("fields.cell");
    },
    unit: "m",
  },
  cell_of_depth: {
    path: "coverage.cell_of_depth",
    part: "limits",
    get label() {
      return say("fields.cellByDepth");
    },
    kind: "survey",
    get placeholder() {
      return say("fields.oneSize");
    },
    optional: true,
  },
  accuracy_m: {
    path: "accuracy_m",
    part: "quality",
    get label() {
      return say("fields.accuracy");
    },
    unit: "m",
  },
  shoal_depth_m: {
    path: "shoal_depth_m",
    part: "shoals",
    get label() {
      return say("fields.shoalAbove");
    },
    unit: "m",
    kind: "survey",
    get placeholder() {
      return say("fields.noLayer");
    },
    optional: true,
  },
  overlap_pct: {
    path: "coverage.overlap_pct",
    part: "coverage",
    get label() {
      return say("fields.overlapOfSwaths");
    },
    unit: "%",
    kind: "survey",
  },
  crosslines_pct: {
    path: "coverage.crosslines_pct",
    part: "crosslines",
    get label() {
      return say("crosslines.crosslines");
    },
    unit: "%",
    kind: "survey",
  },
  tide_m: {
    path: "tide.level_m",
    part: "tide",
    get label() {
      return say("fields.level");
    },
    unit: "m",
    get placeholder() {
      return say("fields.none");
    },
    optional: true,
  },
  sd_range_m: {
    path: "uncertainty.range_m",
    part: "uncertainty",
    get label() {
      return say("fields.range");
    },
    unit: "m",
    kind: "survey",
  },
  sd_range_pct: {
    path: "uncertainty.range_pct",
    part: "uncertainty",
    get label() {
      return say("fields.rangeByLength");
    },
    unit: "%",
    kind: "survey",
  },
  sd_beam_angle_deg: {
    path: "uncertainty.beam_angle_deg",
    part: "uncertainty",
    get label() {
      return say("fields.beamAngle");
    },
    unit: "°",
    kind: "survey",
  },
  sd_roll_deg: {
    path: "uncertainty.roll_deg",
    part: "uncertainty",
    get label() {
      return say("fields.roll");
    },
    unit: "°",
    kind: "survey",
  },
  sd_pitch_deg: {
    path: "uncertainty.pitch_deg",
    part: "uncertainty",
    get label() {
      return say("fields.pitch");
    },
    unit: "°",
    kind: "survey",
  },
  sd_heading_deg: {
    path: "uncertainty.heading_deg",
    part: "uncertainty",
    get label() {
      return say("fields.heading");
    },
    unit: "°",
    kind: "survey",
  },
  sd_roll_patch_deg: {
    path: "uncertainty.roll_patch_deg",
    part: "uncertainty",
    get label() {
      return say("fields.rollOfTheMounting");
    },
    unit: "°",
    kind: "survey",
  },
  sd_heave_m: {
    path: "uncertainty.heave_m",
    part: "uncertainty",
    get label() {
      return say("fields.heave");
    },
    unit: "m",
    kind: "survey",
  },
  sd_waterline_m: {
    path: "uncertainty.waterline_m",
    part: "uncertainty",
    get label() {
      return say("fields.waterline");
    },
    unit: "m",
    kind: "survey",
  },
  sd_surface_sound_speed_mps: {
    path: "uncertainty.surface_sound_speed_mps",
    part: "uncertainty",
    get label() {
      return say("fields.soundSpeedAtTheSonar");
    },
    unit: "m/s",
    kind: "survey",
  },
  sd_sound_speed_profile_mps: {
    path: "uncertainty.sound_speed_profile_mps",
    part: "uncertainty",
    get label() {
      return say("fields.soundSpeedProfile");
    },
    unit: "m/s",
    kind: "survey",
  },
  sd_position_m: {
    path: "uncertainty.position_m",
    part: "uncertainty",
    get label() {
      return say("fields.position");
    },
    unit: "m",
    kind: "survey",
  },
  recovery_radius_m: {
    path: "recovery.radius_m",
    part: "recovery",
    get label() {
      return say("fields.radius");
    },
    unit: "m",
  },
  on_finish: {
    path: "recovery.on_finish",
    part: "recovery",
    get label() {
      return say("fields.onFinish");
    },
  },
  on_low_energy: {
    path: "recovery.on_low_energy",
    part: "recovery",
    get label() {
      return say("fields.onLowEnergy");
    },
  },
  on_lost_link: {
    path: "recovery.on_lost_link",
    part: "recovery",
    get label() {
      return say("fields.onALostLink");
    },
  },
  wait_for_batteries: {
    path: "recovery.wait_for_batteries",
    part: "recovery",
    get label() {
      return say("fields.waitForBatteries");
    },
    kind: "survey",
  },
} as const satisfies Record<string, Field>;

/** The numbers that a single vehicle may have of its own. */
export const VEHICLE_FIELDS = {
  speed_mps: {
    path: "vehicles.speed_mps",
    get label() {
      return say("fleet.speed");
    },
    unit: "m/s",
    kind: "survey",
  },
  altitude_m: {
    path: "vehicles.altitude_m",
    get label() {
      return say("fields.heightAboveBottom");
    },
    unit: "m",
    kind: "survey",
  },
  endurance_min: {
    path: "vehicles.endurance_min",
    get label() {
      return say("fields.endurance");
    },
    unit: "min",
  },
  aperture_deg: {
    path: "vehicles.sonar.aperture_deg",
    get label() {
      return say("fields.aperture");
    },
    unit: "°",
    sensor: "multibeam",
  },
  beams: {
    path: "vehicles.sonar.beams",
    get label() {
      return say("bottomStrip.beams");
    },
    sensor: "multibeam",
  },
  rate_hz: {
    path: "vehicles.sonar.rate_hz",
    get label() {
      return say("fields.pingsASecond");
    },
    unit: "Hz",
    sensor: "multibeam",
  },
  range_m: {
    path: "vehicles.sonar.range_m",
    get label() {
      return say("fields.range");
    },
    unit: "m",
    sensor: "multibeam",
  },
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
  const schema = schemaOf(field);
  return textOf(field, usualOf(schema, kind) ?? schema.example);
}

/** What the service takes in this kind of mission where nothing is said. */
const usualOf = ({ default: usual, inSearch }: Schema, kind: MissionKind): unknown =>
  kind === "search" && inSearch !== undefined ? inSearch : usual;

/** What a mission of the other kind can give one of this kind: neither what only that one has nor its defaults. */
export function carriedOver(mission: Tree, from: MissionKind, kind: MissionKind): Tree {
  if (from === kind) return mission;
  const fields: Field[] = Object.values(FIELDS);
  const itsOwn = fields.filter((field) => field.kind === from).map(({ path }) => path);
  const untouched = Object.entries<Schema>(SPEC).flatMap(([path, schema]) =>
    schema.inSearch !== undefined && valueAt(mission, path.split(".")) === usualOf(schema, from)
      ? [path]
      : [],
  );
  const { search: _s, planner: _p, budget: _b, ...others } = mission;
  return [...itsOwn, ...untouched].reduce((made, path) => without(made, path.split(".")), others as Tree);
}

function without(tree: Tree, [key = "", ...rest]: string[]): Tree {
  const { [key]: inner, ...others } = tree;
  if (inner === undefined || inner === null || rest.length === 0) return others;
  const left = without(inner as Tree, rest);
  return Object.keys(left).length > 0 ? { ...others, [key]: left } : others;
}

/** What all fields begin with. */
export function startTexts(kind: MissionKind): Texts {
  return textsWith((field) => startOf(field, kind));
}

/** Of values in other units than the service's. */
const SHOWN_DIGITS = 6;

/** A value of a mission as it is typed. */
export function textOf(field: Field, value: unknown): string {
  if (value == null || (field.optional && value === schemaOf(field).default)) return "";
  if (typeof value !== "number" || !field.factor) return String(value);
  return String(Number((value / field.factor).toPrecision(SHOWN_DIGITS)));
}

/** The texts of a mission that there is; what it lacks, and what its kind does not have, begins as in a new one. */
export function textsOf(mission: unknown, kind: MissionKind): Texts {
  return textsWith((field) => {
    const value = valueAt(mission, field.path.split("."));
    return value === undefined || (field.kind ?? kind) !== kind ? startOf(field, kind) : textOf(field, value);
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

/** A mission with the values that were typed in these fields; one whose text is what it is shown as stays to all its digits. */
export function withTexts(mission: Tree, texts: Texts, fields: readonly [FieldName, Field][]): Tree {
  return fields.reduce((made, [name, field]) => {
    const path = field.path.split(".");
    const now = valueAt(made, path);
    const value = typedValue(field, texts[name]);
    const stays = value === undefined || (now != null && textOf(field, now) === texts[name]);
    return stays ? made : put(made, path, value);
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
  if (text.trim() === "" || !Number.isFinite(value)) return say("fields.needsANumber", { label });
  if (schema.type === "integer" && !Number.isInteger(value))
    return say("fields.needsAWholeNumber", { label });
  return isWithin(value * factor, schema)
    ? ""
    : say("fields.mustBe", { label, schema: boundsIn(schema, factor) });
}

/** What is wrong with how deep it is said to be; it need not be said. */
export const floorDepthFault = (text: string): string =>
  text.trim() === "" ? "" : numberFault(say("asked.depthOfTheBottom"), text, SPEC.floor_depth_m);

export function isWithin(value: number, schema: Schema): boolean {
  const { minimum = -Infinity, exclusiveMinimum = -Infinity } = schema;
  const { maximum = Infinity, exclusiveMaximum = Infinity } = schema;
  return value >= minimum && value > exclusiveMinimum && value <= maximum && value < exclusiveMaximum;
}

function boundsIn(schema: Schema, factor: number): string {
  const { minimum, maximum } = schema;
  if (minimum !== undefined && maximum !== undefined) {
    return say("fields.betweenAnd", { minimum: minimum / factor, maximum: maximum / factor });
  }
  const words = [
    [say("fields.atLeast"), minimum],
    [say("fields.moreThan"), schema.exclusiveMinimum],
    [say("fields.atMost"), maximum],
    [say("fields.lessThan"), schema.exclusiveMaximum],
  ] as const;
  return words
    .flatMap(([how, bound]) => (bound === undefined ? [] : [`${how} ${bound / factor}`]))
    .join(say("fields.and"));
}
