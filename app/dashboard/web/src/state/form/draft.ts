/** A mission being described: the form's fields, checked and turned into what the service takes. Pure. */

import SPEC from "../../api/mission.json";
import type { LngLat, MissionView, NewMission, Sensor, SurveyLine, VehicleSpec } from "../../api/types";
import { areaFault, polygonOf, ringOf, sizeOf } from "../../map/area";
import { rectangle, wayBetween } from "../../map/geo";
import { say } from "../../words/say";
import { placeOf, placeSample, typedPlace } from "../coordinates";
import {
  carriedOver,
  FIELDS,
  type Field,
  type FieldName,
  fieldFault,
  fieldsOf,
  floorDepthFault,
  type LengthUnit,
  type MissionKind,
  numberFault,
  ownPath,
  put,
  type Schema,
  startOf,
  startTexts,
  type Texts,
  type Tree,
  textsOf,
  VEHICLE_FIELDS,
  type VehicleField,
  valueAt,
  vehicleFieldsOf,
  withTexts,
} from "./missionFields";
import {
  EVEN_LINES,
  fliesCrosslines,
  lastsForLines,
  linesOf,
  optionFault,
  optionTexts,
  typedOptions,
  wayForLines,
} from "./plannerOptions";
import { linesFor, wayForPlan } from "./surveyLines";

/** How the area is given: typed as a rectangle, or as a ring that was drawn or came in a file. */
export type AreaSource = "typed" | "drawn";

/** What one vehicle has of its own, as typed; `recovery_point` as "latitude, longitude". */
export type Own = Partial<Record<VehicleField | "recovery_point", string>> & { sensor?: Sensor };

/** An area of several that are flown one after the other. */
export interface Block {
  /** Empty: it is called by its place in the order. */
  name: string;
  ring: readonly LngLat[];
}

/** As typed. */
export interface Draft extends Texts {
  name: string;
  kind: MissionKind;
  /** Id of the site that a survey belongs to; empty: to none. */
  site: string;
  length: LengthUnit;
  /** How far apart lines over the whole area are to be, which is another way to give the length; empty: it is given. */
  spacing_m: string;
  /** Whether the length is what all lines of the plan take. */
  until_lines: boolean;
  /** How deep it is, for plan and forecast alone; empty: they guess. */
  floor_depth_m: string;
  /** As "latitude, longitude". */
  goal: string;
  entry: string;
  obstacles: readonly (readonly LngLat[])[];
  /** Where vehicles come home to, as "latitude, longitude"; empty: they stop where they are. */
  recovery: string;
  source: AreaSource;
  ring: readonly LngLat[];
  keepOut: readonly (readonly LngLat[])[];
  /** Of a line plan, for even lines to be flown as they are given. */
  lines: readonly SurveyLine[];
  /** The other areas, in their order; `turn` is the place among all of the one that the form's fields describe. */
  blocks: readonly Block[];
  turn: number;
  block_name: string;
  latitude: string;
  longitude: string;
  east_m: string;
  north_m: string;
  tide_source: string;
  tide_table: string;
  planner: string;
  /** The planner's settings, as typed. */
  options: Readonly<Record<string, string>>;
  simulated: string;
  /** Of the simulated vehicles that have no other of their own. */
  sensor: Sensor;
  /** Of the simulated vehicles, separated by commas; empty: sim-1, sim-2 and so on. */
  names: string;
  chosen: readonly VehicleSpec[];
  /** By vehicle. */
  own: Readonly<Record<string, Own>>;
  /** Names that vehicles are to have while others are still called so, by vehicle. */
  wanted: Readonly<Record<string, string>>;
  /** What a mission that is copied has and the form does not show. */
  base: Partial<NewMission>;
}

/** What a fault belongs to: a field, a number of one vehicle, a setting of the planner, or a value of the service that the form does not have. */
export type FaultKey = keyof Draft | `own.${string}` | `options.${string}` | `other.${string}`;

export type Faults = Partial<Record<FaultKey, string>>;

/** The fault of what a vehicle has of its own. */
export const ownKey = (name: string, field: keyof Own): FaultKey => `own.${name}.${field}`;

/** Planners in plain words, the sensible one first. */
export const PLANNER_PRESETS: Readonly<Record<string, { title: string; words: string }>> = {
  cao: {
    get title() {
      return say("draft.asSureAsTheTimeAllows");
    },
    get words() {
      return say("draft.adaptiveBeginsEvenlyAndGoes");
    },
  },
  lawnmower: {
    get title() {
      return say("draft.evenLines");
    },
    get words() {
      return say("draft.parallelLinesOverTheWhole");
    },
  },
  swath: {
    get title() {
      return say("draft.fullCoverage");
    },
    get words() {
      return say("draft.linesAsFarApartAsThe");
    },
  },
};

/** What the service has no default for. */
const SUGGESTED = { east_m: "100", north_m: "100", simulated: "2", sensor: "dvl" } as const;

/** A draft whose area lies in the middle of what the map shows. */
export function emptyDraft(middle: LngLat): Draft {
  const draft: Draft = {
    ...startTexts("survey"),
    ...SUGGESTED,
    name: "",
    kind: "survey",
    site: "",
    length: "steps",
    spacing_m: "",
    until_lines: false,
    floor_depth_m: "",
    goal: "",
    entry: "",
    obstacles: [],
    recovery: "",
    source: "typed",
    ring: [],
    keepOut: [],
    lines: [],
    blocks: [],
    turn: 0,
    block_name: "",
    latitude: "",
    longitude: "",
    tide_source: "",
    tide_table: "",
    planner: SPEC["planner.name"].default,
    options: {},
    names: "",
    chosen: [],
    own: {},
    wanted: {},
    base: {},
  };
  return { ...draft, ...centred(draft, middle) };
}

/** Where the water level of a mission comes from that has none. */
const NO_TIDE: string = SPEC["tide.source"].default;

/** Whether a level was stated, be it of nothing. */
const isLevel = ({ level_m = 0, source = NO_TIDE }: NonNullable<NewMission["tide"]>): boolean =>
  level_m !== 0 || source !== NO_TIDE;

/** A description for another day: without casts and water levels, with the datum and what is wrong with instruments. */
export function withoutDaysWater(described: Partial<NewMission>): Partial<NewMission> {
  const { sound_speed: _, tide = {}, systematic_errors: errors, ...others } = described;
  const { datum_epsg, datum_offset_m } = tide;
  const datum = { ...(datum_epsg ? { datum_epsg } : {}), ...(datum_offset_m ? { datum_offset_m } : {}) };
  const instruments = Object.entries(errors?.vehicles ?? {}).map(
    ([name, wrong]) => [name, { ...wrong, sound_speed_mps: 0 }] as const,
  );
  return {
    ...others,
    ...(Object.keys(datum).length > 0 ? { tide: datum } : {}),
    ...(errors
      ? { systematic_errors: { ...errors, water_level: [], vehicles: Object.fromEntries(instruments) } }
      : {}),
  };
}

/** Whether a description holds casts or water levels of its day. */
export function hasDaysWater({
  sound_speed,
  tide = {},
  systematic_errors: errors,
}: Partial<NewMission>): boolean {
  const steered = Object.values(errors?.vehicles ?? {}).some(({ sound_speed_mps }) => sound_speed_mps !== 0);
  return !!sound_speed || isLevel(tide) || !!errors?.water_level?.length || steered;
}

/** A new mission like one that there is, for another day; its vehicles as they are described there. */
export function copyOf(mission: Pick<MissionView, "spec" | "name">): Draft {
  const draft = draftFrom(mission);
  return {
    ...draft,
    name: say("draft.copy", { name: mission.name }),
    tide_m: "",
    tide_source: "",
    base: withoutDaysWater(draft.base),
  };
}

/** A draft that describes a mission as it is described. */
export function draftFrom({ spec, name }: Pick<MissionView, "spec" | "name">): Draft {
  const ring = ringOf(spec.area as NewMission["area"]);
  const { steps: _, after: _after, survey_lines: lines = [], ...base } = spec;
  const { search, tide } = base;
  const places = search && {
    goal: typedPlace(search.goal as LngLat),
    entry: typedPlace(search.entry as LngLat),
    obstacles: search.obstacles.map((one) => ringOf(one as NewMission["area"])),
  };
  const texts = textsOf(spec, spec.kind);
  const isStated = isLevel(tide);
  return {
    ...emptyDraft(ring[0] ?? [0, 0]),
    ...texts,
    ...places,
    name,
    kind: spec.kind,
    site: spec.site ?? "",
    length: Object.keys(spec.budget)[0] as LengthUnit,
    source: "drawn",
    ring,
    keepOut: spec.keep_out.map((zone) => ringOf(zone as NewMission["area"])),
    lines: lines as SurveyLine[],
    tide_m: isStated ? String(tide.level_m) : "",
    tide_source: isStated ? tide.source : "",
    ...(spec.kind === "survey"
      ? { planner: spec.planner.name, options: optionTexts(spec.planner.options) }
      : {}),
    recovery: spec.recovery ? typedPlace(spec.recovery.point as LngLat) : "",
    simulated: "0",
    chosen: spec.vehicles.map(
      ({ speed_mps: _s, altitude_m: _a, endurance_min: _e, recovery_point: _p, sonar: _, ...vehicle }) =>
        vehicle as VehicleSpec,
    ),
    own: Object.fromEntries(spec.vehicles.map((vehicle) => [vehicle.name, ownOf(vehicle as VehicleSpec)])),
    base: base as Partial<NewMission>,
  };
}

/** What a vehicle that is described has of its own. */
function ownOf({ recovery_point, ...vehicle }: VehicleSpec): Own {
  const numbers = Object.entries(VEHICLE_FIELDS).flatMap(([name, field]) => {
    const value = valueAt(vehicle, ownPath(field));
    return value == null ? [] : [[name, String(value)]];
  });
  return {
    ...Object.fromEntries(numbers),
    ...(recovery_point ? { recovery_point: typedPlace(recovery_point) } : {}),
  };
}

/** What changes with the kind of mission: fields that nobody touched take that one's defaults. */
export function turnedInto(kind: MissionKind, draft: Draft): Partial<Draft> {
  const untouched = fieldsOf(kind, draft.length).filter(
    ([name, field]) => draft[name] === startOf(field, draft.kind),
  );
  return { kind, ...Object.fromEntries(untouched.map(([name, field]) => [name, startOf(field, kind)])) };
}

/** Names of the simulated vehicles: those that were given, for the rest such as nobody else has. */
export function simulatedNames(draft: Draft): string[] {
  // As many as are asked for while a number is typed, but never more than a mission can have.
  const asked = Number(draft.simulated);
  const wanted = Number.isInteger(asked) ? Math.min(asked, SPEC.vehicles.maxItems) : 0;
  const given = draft.names
    .split(",")
    .map((name) => name.trim())
    .filter((name) => name !== "");
  const names = given.slice(0, wanted);
  const taken = new Set([...draft.chosen.map((v) => v.name), ...names]);
  for (let n = 1; names.length < wanted; n++) {
    if (!taken.has(`sim-${n}`)) names.push(`sim-${n}`);
  }
  return names;
}

/** Names of all vehicles, those that were chosen first. */
export const vehicleNames = (draft: Draft): string[] => [
  ...draft.chosen.map((vehicle) => vehicle.name),
  ...simulatedNames(draft),
];

/** How a vehicle of this name sounds the bottom. */
export const sensorOf = (draft: Draft, name: string): Sensor =>
  draft.own[name]?.sensor ?? draft.chosen.find((vehicle) => vehicle.name === name)?.sensor ?? draft.sensor;

/** All simulated vehicles sound the bottom so, also those of a mission that is copied; real ones have what they have. */
export function withSensor(sensor: Sensor, { chosen, own }: Draft): Partial<Draft> {
  const real = new Set(chosen.filter(({ kind }) => kind !== "sim").map(({ name }) => name));
  return {
    sensor,
    chosen: chosen.map((vehicle) => (real.has(vehicle.name) ? vehicle : { ...vehicle, sensor })),
    own: Object.fromEntries(
      Object.entries(own).map(([name, { sensor: its, ...others }]) => [
        name,
        real.has(name) && its ? { ...others, sensor: its } : others,
      ]),
    ),
  };
}

/** Whether a planner can lead these vehicles. */
export const canPlan = (planner: string, draft: Draft): boolean =>
  planner !== "swath" || vehicleNames(draft).every((name) => sensorOf(draft, name) === "multibeam");

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

const LONGITUDE: Schema = SPEC["area.coordinates.0"];
const LATITUDE: Schema = SPEC["area.coordinates.1"];
const SIZE: Schema = { type: "number", exclusiveMinimum: 0 };
/** Numbers that are no value of a mission but what values are made of. */
const corner = () =>
  [
    ["latitude", say("draft.latitude"), LATITUDE],
    ["longitude", say("draft.longitude"), LONGITUDE],
    ["east_m", say("draft.sizeToTheEast"), SIZE],
    ["north_m", say("draft.sizeToTheNorth"), SIZE],
  ] as const;
const VEHICLES: Schema = { type: "integer", minimum: 0, maximum: SPEC.vehicles.maxItems };

/** The draft with the length that its lines ask of each vehicle, where it is given by how far they are apart. */
export function resolved(draft: Draft): Draft {
  const each_km = eachByLines(draft, cornersOf(draft));
  return each_km === null ? draft : { ...draft, length: "km_per_vehicle", km_per_vehicle: String(each_km) };
}

/** Kilometres that each vehicle may fly for lines over an area; null where neither they nor their distance are said. */
function eachByLines(draft: Draft, ring: readonly LngLat[]): number | null {
  const spacing_m = Number(draft.spacing_m);
  const vehicles = vehicleNames(draft).length;
  if (lastsForLines(draft) && vehicles > 0) {
    return Number((wayForPlan(linesFor(linesOf(draft), ring), vehicles) / 1000).toPrecision(3));
  }
  if (!(spacing_m > 0) || vehicles === 0 || ring.length < 3) return null;
  const { area_m2, east_m, north_m } = sizeOf(ring);
  const each_m = wayForLines(draft, area_m2 / (spacing_m * vehicles), Math.hypot(east_m, north_m));
  return Number((each_m / 1000).toPrecision(3));
}

/** What a mission's length is said in. */
export type LengthChoice = LengthUnit | "spacing_m" | "lines";

export const lengthChoiceOf = (draft: Draft): LengthChoice =>
  lastsForLines(draft) ? "lines" : draft.spacing_m.trim() === "" ? draft.length : "spacing_m";

/** The length said in something else; lines begin as far apart as the length that there was would lay them. */
export function withLength(choice: LengthChoice, draft: Draft): Partial<Draft> {
  if (choice === "lines") return { until_lines: true, spacing_m: "" };
  if (choice !== "spacing_m") return { length: choice, spacing_m: "", until_lines: false };
  const corners = cornersOf(draft);
  const now = corners.length > 2 ? estimate(draft, sizeOf(corners).area_m2) : null;
  return { spacing_m: now ? String(Number(now.spacing_m.toPrecision(2))) : "1" };
}

/** The plain fields that count for what is described; of the length the one that is said. */
function fieldsThatCount(draft: Draft): [FieldName, Field][] {
  return fieldsOf(draft.kind, draft.length).filter(([, { part }]) => {
    if (part === "coverage") return draft.planner === "swath";
    if (part === "crosslines") return fliesCrosslines(draft);
    return part !== "recovery" || draft.recovery.trim() !== "";
  });
}

/** What is wrong with a draft, field by field, with what would be right; only what the form shows is judged. */
export function faultsOf(draft: Draft): Faults {
  const faults: Faults = {};
  const note = (field: FaultKey, fault: string) => {
    if (fault) faults[field] = fault;
  };
  note("name", draft.name.trim() ? "" : say("draft.giveTheMissionAName"));
  if (draft.source === "typed") {
    for (const [field, label, schema] of corner()) note(field, numberFault(label, draft[field], schema));
  }
  for (const [name, field] of fieldsThatCount(draft)) {
    if (field.part !== "length" || lengthChoiceOf(draft) === name) note(name, fieldFault(field, draft[name]));
  }
  if (draft.recovery.trim() !== "" && !placeOf(draft.recovery)) {
    faults.recovery = say("draft.pickTheRecoveryPointOnThe", { sample: placeSample() });
  }
  // A table has its own source.
  if (draft.tide_source.trim() !== "" && draft.tide_table === "")
    note("tide_m", numberFault(FIELDS.tide_m.label, draft.tide_m, SPEC["tide.level_m"]));
  note("simulated", numberFault(say("vehicles.simulatedVehicles"), draft.simulated, VEHICLES));
  const cell_m = faults.cell_m ? 0 : Number(draft.cell_m);
  if (draft.source === "drawn" && draft.ring.length === 0) faults.ring = say("draft.drawTheAreaOrReadIt");
  else if (draft.source === "drawn" || areaOf(draft)) {
    note("ring", areaFault(draft.source === "drawn" ? draft.ring : cornersOf(draft), cell_m));
  }
  if (draft.kind === "survey") {
    if (lengthChoiceOf(draft) === "spacing_m") note("spacing_m", spacingFault(draft));
    note("floor_depth_m", floorDepthFault(draft.floor_depth_m));
    note("blocks", blocksFault(draft, cell_m));
    for (const [name, text] of Object.entries(draft.options))
      note(`options.${name}`, optionFault(name, text));
    if (!canPlan(draft.planner, draft)) faults.planner = say("draft.fullCoverageNeedsVehicles");
  }
  draft.keepOut.forEach((zone, i) => {
    const fault = areaFault(zone, 0);
    if (fault) faults.keepOut = say("draft.keepOutZone", { i: i + 1, fault: fault.toLowerCase() });
  });
  if (draft.kind === "search") {
    for (const [field, words] of [
      ["goal", say("draft.theGoal")],
      ["entry", say("draft.theEntry")],
    ] as const) {
      if (!placeOf(draft[field]))
        faults[field] = say("draft.pickOnTheMapOrType", { words, sample: placeSample() });
    }
    draft.obstacles.forEach((ring, i) => {
      const fault = areaFault(ring, 0);
      if (fault) faults.obstacles = say("draft.obstacle", { i: i + 1, fault: fault.toLowerCase() });
    });
  }
  const shallowest = draft.kind === "survey" ? Number(draft.min_depth_m) : 0;
  if (!faults.max_depth_m && !faults.min_depth_m && Number(draft.max_depth_m) < shallowest) {
    faults.max_depth_m = say("draft.deepestTravelMustNotBeAbove");
  }
  if (!faults.simulated) {
    const all = vehicleNames(draft).flatMap((name) => [
      name,
      ...(draft.wanted[name] ? [draft.wanted[name]] : []),
    ]);
    const wrong = all.find((name) => !isVehicleName(name));
    if (wrong !== undefined)
      faults.names = say("draft.isNoNameOfAVehicle", {
        name: wrong || say("draft.nothing"),
        most: NAME.maxLength,
      });
    const twice = all.find((name, i) => all.indexOf(name) !== i);
    if (twice !== undefined)
      faults.names = say("draft.twoVehiclesAreCalled", { twice: twice || say("draft.nothing") });
  }
  if (!faults.simulated && Number(draft.simulated) + draft.chosen.length === 0) {
    faults.simulated = say("draft.chooseAtLeastOneVehicleOr");
  }
  for (const name of vehicleNames(draft)) Object.assign(faults, ownFaults(name, draft));
  return faults;
}

/** What is wrong with the first of the areas that the fields do not describe. */
function blocksFault(draft: Draft, cell_m: number): string {
  const faults = allBlocks(draft).map((block, i) => {
    const fault = i === draft.turn ? "" : areaFault(block.ring, cell_m);
    return fault && ofBlock(block, i, fault);
  });
  return faults.find((fault) => fault !== "") ?? "";
}

/** What is wrong with how far lines are to be apart: with the number, or with the way that it asks of each vehicle. */
function spacingFault(draft: Draft): string {
  const fault =
    numberFault(say("draft.distanceOfLines"), draft.spacing_m, SIZE) ||
    (draft.planner === EVEN_LINES ? optionFault("line_spacing_m", draft.spacing_m) : "");
  if (fault) return fault;
  const most_km = SPEC["budget.km_per_vehicle"].maximum;
  const each_km = Math.max(...allBlocks(draft).map(({ ring }) => eachByLines(draft, ring) ?? 0));
  return each_km > most_km
    ? say("draft.linesSoCloseAre", { spacing: draft.spacing_m.trim(), each: each_km, most: most_km })
    : "";
}

const NAME = SPEC["vehicles.name"];
const isVehicleName = (name: string) => name.length <= NAME.maxLength && new RegExp(NAME.pattern).test(name);

/** What is wrong with what a vehicle has of its own. */
function ownFaults(name: string, draft: Draft): Faults {
  const own = draft.own[name] ?? {};
  const faults: Faults = {};
  for (const [field, declared] of vehicleFieldsOf(draft.kind, sensorOf(draft, name))) {
    const label = say("draft.of", { label: declared.label, name });
    const fault = fieldFault({ ...declared, label, optional: true }, own[field] ?? "");
    if (fault) faults[ownKey(name, field)] = fault;
  }
  const point = own.recovery_point?.trim() ?? "";
  if (point !== "" && !placeOf(point))
    faults[ownKey(name, "recovery_point")] = say("draft.recoveryPointOfType", {
      name,
      sample: placeSample(),
    });
  return faults;
}

/** The area that a draft describes; null while it describes none. */
export function areaOf(draft: Draft) {
  if (draft.source === "drawn") return draft.ring.length >= 3 ? polygonOf(draft.ring) : null;
  if (corner().some(([field, label, schema]) => numberFault(label, draft[field], schema) !== "")) return null;
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

/** All areas in their order. */
export function allBlocks(draft: Draft): Block[] {
  const mine = { name: draft.block_name, ring: cornersOf(draft) };
  return [...draft.blocks.slice(0, draft.turn), mine, ...draft.blocks.slice(draft.turn)];
}

export const blockTitle = ({ name }: Pick<Block, "name">, i: number): string =>
  name.trim() || say("blocks.block", { i: i + 1 });

/** A fault of one block of several, with what that is called. */
export const ofBlock = (block: Block, i: number, fault: string): string =>
  `${blockTitle(block, i)}: ${fault}`;

/** What to send for a draft without faults; of several blocks for the one that its fields describe. */
export function toMission(described: Draft): NewMission {
  const draft = resolved(described);
  const area = areaOf(draft);
  if (!area) throw new Error("the draft has faults");
  const from = draft.base.kind ?? draft.kind;
  const carried: Partial<NewMission> = carriedOver(draft.base, from, draft.kind);
  const { search: _s, budget: _b, recovery: before, site: _site, tide, ...base } = carried;
  const point = placeOf(draft.recovery);
  const simulated = simulatedNames(draft).map(
    (name): VehicleSpec => ({ name, kind: "sim", sensor: draft.sensor }),
  );
  // At which depth they travel is another matter in a mission of the other kind.
  const chosen =
    from === draft.kind
      ? draft.chosen
      : draft.chosen.map(({ depth_m: _, ...vehicle }) => vehicle as VehicleSpec);
  const vehicles = [...chosen, ...simulated].map((vehicle) => withOwn(vehicle, draft));
  const mission = {
    ...base,
    name: draft.name.trim(),
    kind: draft.kind,
    area,
    keep_out: draft.keepOut.map(polygonOf),
    ...plannedLines(draft, base.coverage),
    vehicles,
    ...(draft.kind === "survey" && draft.site ? { site: draft.site } : {}),
    ...tideOf(draft, tide),
    ...(draft.kind === "search"
      ? searchOf({ ...draft, base: carried }, vehicles)
      : { planner: { name: draft.planner, options: typedOptions({ ...draft, base: carried }) } }),
  };
  const { recovery, ...made } = withTexts(mission, draft, fieldsThatCount(draft));
  const homing = point ? { recovery: { ...before, ...(recovery as object), point } } : {};
  return { ...made, ...homing } as unknown as NewMission;
}

/** The lines of the plan, which has its own crosslines. */
function plannedLines(draft: Draft, coverage: NewMission["coverage"]): Partial<NewMission> {
  const all = linesOf(draft);
  if (all.length === 0) return {};
  return {
    survey_lines: linesFor(all, cornersOf(draft)),
    coverage: { ...coverage, crosslines_pct: 0 },
  };
}

/** The level's source, and what the form does not show of the tide; the level itself is a plain field. */
function tideOf({ tide_m, tide_source }: Draft, before: NewMission["tide"]): Pick<NewMission, "tide"> {
  const { level_m: _l, source: _s, ...others } = before ?? {};
  const isStated = tide_m.trim() !== "";
  const source = isStated ? { source: tide_source.trim() || say("draft.statedByTheOperator") } : {};
  const tide = { ...others, ...source };
  return Object.keys(tide).length > 0 ? { tide } : {};
}

function withOwn(vehicle: VehicleSpec, draft: Draft): VehicleSpec {
  const own = draft.own[vehicle.name] ?? {};
  const sensor = sensorOf(draft, vehicle.name);
  const made = vehicleFieldsOf(draft.kind, sensor).reduce<Tree>(
    (described, [name, field]) => {
      const text = own[name]?.trim();
      return text ? put(described, ownPath(field), Number(text)) : described;
    },
    { ...vehicle, sensor },
  );
  const point = placeOf(own.recovery_point ?? "");
  return { ...made, ...(point ? { recovery_point: point } : {}) } as VehicleSpec;
}

/** What a search's steps follow from, where nobody said how many: with another window there are others. */
const LENGTH_OF_SEARCH = ["window_min", "speed_mps", "max_step_m"] as const;

/** What only a search has: its places, and vehicles at the surface. Planner and length are left to the service. */
function searchOf(draft: Draft, vehicles: readonly VehicleSpec[]) {
  const { base, goal, entry, obstacles, ...texts } = draft;
  const places = { goal: placeOf(goal), entry: placeOf(entry) };
  if (!places.goal || !places.entry) throw new Error("the draft has faults");
  const search = { ...base.search, ...places, obstacles: obstacles.map(polygonOf) };
  const before = textsOf(base, "search");
  const sameLength = base.budget && LENGTH_OF_SEARCH.every((name) => texts[name] === before[name]);
  if (base.kind === "search") return { search, ...(sameLength ? { budget: base.budget } : {}) };
  const depth_m = SPEC["vehicles.depth_m"].minimum;
  return {
    search,
    limits: { ...base.limits, min_depth_m: SPEC["limits.min_depth_m"].minimum },
    vehicles: vehicles.map((vehicle) => (vehicle.kind === "sim" ? { ...vehicle, depth_m } : vehicle)),
  };
}

/** What one vehicle does at most: its way, its time, and how long its energy lasts; null: that is not known. */
export interface Share {
  name: string;
  metres: number;
  seconds: number;
  endurance_s: number | null;
}

export interface Estimate {
  seconds: number;
  metres: number;
  /** How far apart lines over the whole area would be. */
  spacing_m: number;
  shares: readonly Share[];
  /** From the recovery point to the farthest corner of the area; null: there is none. */
  farthest_m: number | null;
}

/** How long a mission takes at most and how far its vehicles go; null while that is not said. */
export function estimate(described: Draft, area_m2: number): Estimate | null {
  const draft = resolved(described);
  const shares = vehicleNames(draft).map((name): Share => {
    const own = draft.own[name];
    const speed = Number(own?.speed_mps?.trim() || draft.speed_mps);
    const metres = wayOf(draft, speed);
    const endurance_s = Number(own?.endurance_min?.trim() ?? "") * 60;
    return { name, metres, seconds: metres / speed, endurance_s: endurance_s > 0 ? endurance_s : null };
  });
  const metres = shares.reduce((sum, share) => sum + share.metres, 0);
  const seconds = Math.max(...shares.map((share) => share.seconds));
  if (!(metres > 0 && seconds > 0)) return null;
  const home = placeOf(draft.recovery);
  const farthest_m = home && Math.max(...cornersOf(draft).map((corner) => wayBetween(home, corner).metres));
  return { seconds, metres, spacing_m: area_m2 / metres, shares, farthest_m };
}

/** How far a vehicle of this speed goes at most, metres. */
function wayOf(draft: Draft, speed_mps: number): number {
  const length = Number(draft[draft.length]);
  if (draft.length === "minutes") return length * 60 * speed_mps;
  return length * (draft.length === "steps" ? Number(draft.max_step_m) : 1000);
}

/** The form's fields for what is no plain value. */
const OTHERS: [path: string, field: keyof Draft][] = [
  ["search.goal", "goal"],
  ["search.entry", "entry"],
  ["search.obstacles", "obstacles"],
  ["recovery", "recovery"],
  ["planner", "planner"],
  ["tide", "tide_m"],
  ["vehicles", "simulated"],
  ["keep_out", "keepOut"],
  ["survey_lines", "lines"],
  ["area", "ring"],
  ["name", "name"],
  ["site", "site"],
];

/** What is at fault where a service refuses a draft for one of its own fields. */
export function fieldOf(serviceField: string, draft: Draft): FaultKey {
  const [, place, part] = /^vehicles\.(\d+)\.(.+)$/.exec(serviceField) ?? [];
  if (part) return vehicleFieldOf(part, vehicleNames(draft)[Number(place)] ?? "");
  const [, option] = /^planner\.options\.(\w+)/.exec(serviceField) ?? [];
  if (option) return `options.${option}`;
  if (serviceField.startsWith("budget.") && draft.kind === "survey") return lengthChoiceOf(draft);
  const plain = Object.entries(FIELDS).map(([name, { path }]) => [path, name as FieldName] as const);
  const found = [...plain, ...OTHERS].find(([known]) => `${serviceField}.`.startsWith(`${known}.`));
  return found?.[1] ?? `other.${serviceField}`;
}

/** What is at fault where a part of a vehicle's description is refused. */
function vehicleFieldOf(part: string, name: string): FaultKey {
  if (part === "name") return "names";
  const own = [
    ...Object.entries(VEHICLE_FIELDS),
    ["recovery_point", { path: "vehicles.recovery_point" }],
  ] as [keyof Own, { path: string }][];
  const found = own.find(([, { path }]) => `vehicles.${part}.`.startsWith(`${path}.`));
  return found ? ownKey(name, found[0]) : "simulated";
}
