import { expect, it } from "vitest";
import type { NewMission } from "../../api/types";
import { type Draft, emptyDraft, faultsOf, toMission } from "./draft";
import { draftIn, draftOf, fileNameOf, missionFile, withTemplate } from "./missionFile";

const described = (changes: Partial<Draft> = {}): Draft => ({
  ...emptyDraft([-8.705, 41.185]),
  ...{
    name: "Quay, north",
    recovery: "41.1851, -8.705",
    accuracy_m: "0.5",
    length: "minutes",
    minutes: "42",
  },
  keepOut: [
    [
      [-8.705, 41.185],
      [-8.7049, 41.185],
      [-8.7049, 41.1851],
    ],
  ],
  own: { "sim-1": { endurance_min: "90", recovery_point: "41.1852, -8.7051" } },
  ...changes,
});

it("a mission comes back from its file as it was", () => {
  const mission = toMission(described());
  const back = draftIn("quay.mission.json", missionFile(mission, "a table"));
  expect(toMission(back)).toEqual(mission);
  expect(back.tide_table).toBe("a table");
  expect(faultsOf(back)).toEqual({});
});

it("what is not said in a file takes the service's defaults", () => {
  const { name, area } = toMission(described());
  const draft = draftIn(
    "short.json",
    JSON.stringify({ name, area, vehicles: [{ name: "a", kind: "rest" }] }),
  );
  expect([draft.length, draft.planner, draft.keepOut]).toEqual(["steps", "cao", []]);
  expect(draft.chosen.map((vehicle) => vehicle.name)).toEqual(["a"]);
});

it.each([
  ["{", "is no JSON"],
  ["null", "holds no mission"],
  ['{"format": "bathyfleet mission"}', "holds no mission"],
  ['{"name": "x", "area": {"coordinates": [[[0, 0]]]}}', "needs a name and an area"],
])("a file of %j is refused in words", (text, words) => {
  expect(() => draftIn("file.json", text)).toThrow(words);
});

it("a template brings everything but names and places", () => {
  const here = { ...emptyDraft([10, 60]), name: "Fjord", recovery: "60, 10" };
  const made = withTemplate(toMission(described()), here);
  expect([made.accuracy_m, made.length, made.minutes]).toEqual(["0.5", "minutes", "42"]);
  expect([made.name, made.recovery, made.latitude, made.keepOut]).toEqual([
    "Fjord",
    "60, 10",
    here.latitude,
    [],
  ]);
  expect(made.own["sim-1"]).toEqual({ endurance_min: "90" });
  expect(draftOf(toMission(made) as NewMission).name).toBe("Fjord");
});

it("files are named after their mission", () => {
  expect(fileNameOf("Leixões: quay / north")).toBe("Leixões-quay-north.mission.json");
  expect(fileNameOf("  ")).toBe("mission.mission.json");
});
