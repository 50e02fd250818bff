import { readFileSync } from "node:fs";
import ts from "typescript";
import { afterEach, describe, expect, it } from "vitest";
import type { MissionView, NewMission } from "../../api/types";
import { copyOf, type Draft, draftFrom, emptyDraft, faultsOf, fieldOf, toMission, turnedInto } from "./draft";
import {
  FIELDS,
  type Field,
  type FieldName,
  fieldFault,
  fieldsOf,
  type LengthUnit,
  schemaOf,
  startOf,
} from "./missionFields";

const ENTRIES = Object.entries(FIELDS) as [FieldName, Field][];
const valueAt = (mission: NewMission, path: string): unknown =>
  path
    .split(".")
    .reduce((part, key) => (part as Record<string, unknown> | undefined)?.[key], mission as unknown);

function draftWith(changes: Partial<Draft>, kind: Draft["kind"] = "survey"): Draft {
  const empty = emptyDraft([-8.705, 41.185]);
  const places = { goal: "41.1853, -8.7045", entry: "41.1851, -8.7049", recovery: "41.1851, -8.705" };
  return { ...empty, ...turnedInto(kind, empty), name: "Quay", ...places, ...changes };
}

/** A mission that was sent, as the service shows it. */
const shown = (mission: NewMission): Pick<MissionView, "name" | "spec"> =>
  ({
    name: "Quay",
    spec: { tide: {}, search: null, planner: { options: {} }, budget: { steps: 100 }, ...mission },
  }) as unknown as MissionView;

describe.each(ENTRIES)("the field %s", (name, field) => {
  const kind = field.kind ?? "survey";
  const schema = schemaOf(field);
  const least = schema.minimum ?? schema.exclusiveMinimum ?? 0;
  const inside = Math.ceil(0.3 * least + 0.7 * (schema.maximum ?? least + 20));
  const other = schema.enum?.find((choice) => choice !== schema.default);
  const isSwitch = schema.type === "boolean";
  const switched = isSwitch ? !schema.default : undefined;
  const text = String(other ?? switched ?? inside / (field.factor ?? 1));
  const length = field.part === "length" ? { length: name as LengthUnit } : {};
  const led = ["coverage", "crosslines"].includes(field.part)
    ? { planner: "swath", sensor: "multibeam" as const }
    : {};

  it("begins with what the service takes where nothing is said", () => {
    const begun = draftWith({}, kind)[name];
    const usual = schema.default ?? schema.example;
    const begins = typeof usual === "number" ? usual / (field.factor ?? 1) : usual;
    expect(begun).toBe(field.optional ? "" : String(begins));
    expect(faultsOf(draftWith(length, kind))).toEqual({});
  });

  it("is held to the service's bounds", () => {
    const past = [least - 1, ...(schema.maximum === undefined ? [] : [schema.maximum + 1])];
    const wrong = other || isSwitch ? [] : past;
    for (const value of wrong) {
      const faults = faultsOf(
        draftWith({ ...length, ...led, [name]: String(value / (field.factor ?? 1)) }, kind),
      );
      expect(faults[name]).toContain(`${field.label} must be`);
    }
    expect(fieldFault(field, text)).toBe("");
  });

  it("is sent at its place, shown again, and has the service's refusal shown beside it", () => {
    const draft = draftWith(
      { ...length, ...led, [name]: text, max_depth_m: name === "max_depth_m" ? text : "6000" },
      kind,
    );
    const mission = toMission(draft);
    expect(valueAt(mission, field.path)).toBe(other ?? switched ?? Number(text) * (field.factor ?? 1));
    expect(draftFrom(shown(mission))).toMatchObject({ ...length, [name]: text });
    expect(fieldOf(field.path, draft)).toBe(name);
  });
});

describe("one entry in the table", () => {
  const table = FIELDS as unknown as Record<string, Field>;
  const added = { path: "sounding_noise", part: "limits", label: "Noise" } as const;

  afterEach(() => {
    delete table.noise;
  });

  it("adds a field to the form, its checks and what is sent", () => {
    table.noise = added;
    const change = (text: string) => ({ ...draftWith({}), noise: text }) as Draft;
    expect(fieldsOf("search", "steps", "limits").map(([name]) => name)).toContain("noise");
    expect((draftWith({}) as unknown as Record<string, string>).noise).toBe("0.01");
    expect(Object.keys(faultsOf(change("2")))).toEqual(["noise"]);
    expect(toMission(change("0.03"))).toMatchObject({ sounding_noise: 0.03 });
    expect(fieldOf("sounding_noise", draftWith({}))).toBe("noise");
  });

  it("adds a choice or a switch just so", () => {
    table.noise = { ...added, path: "tracking.pursue" };
    expect(startOf(table.noise, "survey")).toBe("true");
    expect(toMission({ ...draftWith({}), noise: "false" } as Draft)).toMatchObject({
      tracking: { pursue: false },
    });
    table.noise = { ...added, path: "vehicles.guidance" };
    expect(schemaOf(table.noise).enum).toContain("legs");
    expect(fieldFault(table.noise, "legs")).toBe("");
  });
});

it("fields that nobody touched take the defaults of the kind of mission", () => {
  const survey = draftWith({ accuracy_m: "0.5", max_step_m: "7" });
  const search = { ...survey, ...turnedInto("search", survey) };
  expect([search.speed_mps, search.max_step_m, search.accuracy_m]).toEqual(["1", "7", "0.5"]);
  expect({ ...search, ...turnedInto("survey", search) }.speed_mps).toBe("1.3");
});

it("a value in another unit is shown with few digits and keeps all of them", () => {
  const search = draftWith({ window_min: "20" }, "search");
  const made = toMission(search);
  const spec = { ...made, search: { ...made.search, window_s: 1000 } } as NewMission;
  const copy = copyOf(shown(spec));
  expect(copy.window_min).toBe("16.6667");
  expect(toMission(copy).search?.window_s).toBe(1000);
  expect(toMission({ ...copy, window_min: "20" }).search?.window_s).toBe(1200);
});

/** Numbers in a source, also such as stand in texts. */
function numbersIn(file: string): string[] {
  const source = ts.createSourceFile(file, readFileSync(file, "utf8"), ts.ScriptTarget.ESNext, true);
  const found: string[] = [];
  const look = (node: ts.Node): void => {
    const text = ts.isNumericLiteral(node) || ts.isStringLiteral(node) ? node.text : "";
    if (text.trim() !== "" && Number.isFinite(Number(text))) found.push(text);
    ts.forEachChild(node, look);
  };
  look(source);
  return found;
}

it.each([
  // Seconds in a minute; without a factor: one; digits.
  ["state/form/missionFields.ts", ["60", "1", "6"]],
  // Corners and digits of places; the size of the first rectangle and how many vehicles are simulated at first; seconds
  // in a minute, metres in a kilometre.
  ["state/form/draft.ts", ["1", "2", "3", "6", "60", "100", "1000"]],
  // Corners, digits.
  ["ui/form/NewMissionForm.tsx", ["1", "2"]],
  // Corners, digits, hundredths.
  ["ui/form/SurveyFields.tsx", ["1", "2", "100"]],
  ["ui/form/ExpertFields.tsx", []],
  ["ui/form/MissionTemplates.tsx", []],
  // The first of a list.
  ["ui/form/VehicleFields.tsx", ["1"]],
  ["ui/form/SearchFields.tsx", ["1"]],
  ["ui/form/Fields.tsx", []],
])("%s has no number of a mission", (file, exceptions) => {
  const numbers = numbersIn(`${import.meta.dirname}/../../${file}`);
  expect(numbers.filter((number) => !["0", ...exceptions].includes(number))).toEqual([]);
});
