import { describe, expect, it } from "vitest";
import type { LngLat, NewMission } from "../../api/types";
import { ringOf } from "../../map/area";
import { rectangle } from "../../map/geo";
import { toMissions } from "./blocks";
import { allBlocks, type Draft, emptyDraft, faultsOf, toMission } from "./draft";
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

const SQUARE = '{"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]}';

it.each([
  ["{", "is no JSON"],
  ["null", "holds no mission"],
  ['{"format": "bathyfleet mission"}', "holds no mission"],
  ['{"name": "x", "area": {"coordinates": [[[0, 0]]]}}', "needs a name and an area"],
  [`{"name": "x", "area": ${SQUARE}, "vehicles": {}}`, "is missing or of another kind"],
  [`{"name": "x", "area": ${SQUARE}, "keep_out": [null]}`, "is missing or of another kind"],
  [`{"name": "x", "area": ${SQUARE}, "recovery": {}}`, "is missing or of another kind"],
  [`{"name": "x", "area": {"coordinates": [[[0, 0], [524000, 0], [9, 9], [0, 0]]]}}`, "is no longitude"],
])("a file of %j is refused in words", (text, words) => {
  expect(() => draftIn("file.json", text)).toThrow(words);
});

it("a template brings everything but names and places", () => {
  const here = { ...emptyDraft([10, 60]), name: "Fjord", recovery: "60, 10" };
  const made = withTemplate({ mission: toMission(described()) }, here);
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

describe("lines so far apart", () => {
  const block = (east: number): LngLat[] => ringOf(rectangle([-8.705, 41.185], east, east));
  const spaced = described({
    spacing_m: "10",
    source: "drawn",
    ring: block(100),
    blocks: [{ name: "", ring: block(400) }],
  });
  const each_km = (draft: Draft) => toMissions(draft).map(({ budget }) => budget?.km_per_vehicle);

  it("are so in each block when its file is read", () => {
    expect(each_km(spaced)).toEqual([0.5, 8]);
    const text = missionFile(toMission(spaced), "", allBlocks(spaced), spaced.spacing_m);
    expect(each_km(draftIn("blocks.mission.json", text))).toEqual([0.5, 8]);
  });

  it("are so in another area that a template is taken to", () => {
    const here = { ...emptyDraft([10, 60]), name: "Fjord", east_m: "1000", north_m: "1000" };
    const made = withTemplate({ mission: toMission(spaced), spacing_m: spaced.spacing_m }, here);
    expect(each_km(made)).toEqual([50]);
  });
});

describe("the tide", () => {
  const tide = { level_m: 1.2, source: "gauge", sd_m: 0.1, datum_epsg: 5715, datum_offset_m: -2.5 };
  const mission = { ...toMission(described()), tide } as NewMission;

  it.each([
    tide,
    { ...tide, level_m: 0, source: "gauge at quay" },
    { ...tide, level_m: 0, source: "none applied" },
  ])("of %j is what it was when nobody changed it", (was) => {
    const back = draftIn("tide.json", missionFile({ ...mission, tide: was } as NewMission));
    const { level_m = 0, source = "none applied", ...others } = toMission(back).tide ?? {};
    expect({ level_m, source, ...others }).toEqual(was);
  });

  it("loses its level and nothing else when that is taken away", () => {
    const back = draftIn("tide.json", missionFile(mission));
    const { sd_m, datum_epsg, datum_offset_m } = tide;
    expect(toMission({ ...back, tide_m: "", tide_source: "" }).tide).toEqual({
      sd_m,
      datum_epsg,
      datum_offset_m,
    });
  });

  it("needs a level where it has a source", () => {
    expect(faultsOf(described({ tide_source: "gauge" })).tide_m).toContain("needs a number");
    expect(faultsOf(described({ tide_source: "gauge", tide_table: "a table" }))).toEqual({});
  });

  it("of a day does not come with a template, its datum does", () => {
    const made = toMission(withTemplate({ mission }, { ...emptyDraft([10, 60]), name: "Fjord" }));
    expect(made.tide).toEqual({ datum_epsg: 5715, datum_offset_m: -2.5 });
  });
});

it("files are named after their mission", () => {
  expect(fileNameOf("Leixões: quay / north")).toBe("Leixões-quay-north.mission.json");
  expect(fileNameOf("  ")).toBe("mission.mission.json");
});
