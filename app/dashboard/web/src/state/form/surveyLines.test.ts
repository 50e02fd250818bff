import { describe, expect, it } from "vitest";
import SPEC from "../../api/mission.json";
import type { LngLat, PlannerView, SurveyLine } from "../../api/types";
import { flownBlocks, toMissions, withAreas } from "./blocks";
import { copyOf, type Draft, emptyDraft, faultsOf, lengthChoiceOf, toMission, withLength } from "./draft";
import { draftIn, missionFile, withTemplate } from "./missionFile";
import { endsWithLines, expertOptions, fliesCrosslines, linesOf, shownOptions } from "./plannerOptions";
import { lengthOf, liesElsewhere, linesIn, wayForPlan, withLines, withoutLines } from "./surveyLines";

const WEST = -8.705;
const SOUTH = 41.185;
/** About 84 m and 111 m. */
const STEP = 0.001;
const square = (west: number): LngLat[] => [
  [west, SOUTH],
  [west + STEP, SOUTH],
  [west + STEP, SOUTH + STEP],
  [west, SOUTH + STEP],
];
const line = (name: string, lng: number): SurveyLine => ({
  name,
  coordinates: [
    [lng, SOUTH],
    [lng, SOUTH + STEP],
  ],
  keep_direction: false,
});
const LINES = [line("101", WEST + 0.0003), line("102", WEST + 0.0006)];

const surveyed = (change: Partial<Draft> = {}): Draft => ({
  ...emptyDraft([WEST, SOUTH]),
  name: "Basin",
  source: "drawn",
  ring: square(WEST),
  ...change,
});

const planned = (change: Partial<Draft> = {}): Draft => {
  const draft = surveyed(change);
  return { ...draft, ...withLines(draft, LINES) };
};

describe("lines of a plan", () => {
  it("are sent to the planner that flies them, and last until they are flown", () => {
    const draft = planned();
    expect(faultsOf(draft)).toEqual({});
    expect(lengthChoiceOf(draft)).toBe("lines");
    expect(endsWithLines(draft)).toBe(true);
    const mission = toMission(draft);
    expect(mission.planner?.name).toBe("lawnmower");
    expect(mission.survey_lines).toEqual(LINES);
    const each_km = (mission.budget as { km_per_vehicle: number }).km_per_vehicle;
    expect(each_km).toBeCloseTo(wayForPlan(LINES, 2) / 1000, 2);
    expect(each_km * 1000).toBeGreaterThan(2 * lengthOf(LINES[0] as SurveyLine));
  });

  it("leave nothing that says where other lines lie", () => {
    const options = { line_spacing_m: "10", line_heading_deg: "20", keep_line_order: "true" };
    const before = surveyed({ planner: "lawnmower", spacing_m: "10", options });
    expect(fliesCrosslines(before)).toBe(true);
    const draft = { ...before, ...withLines(before, LINES) };
    expect(fliesCrosslines(draft)).toBe(false);
    const mission = toMission({ ...draft, options });
    expect(mission.planner?.options).toEqual({ keep_line_order: true });
    expect(mission.coverage?.crosslines_pct).toBe(0);
  });

  it("have their settings beside them, and not once more among the planner's own", () => {
    const properties = { keep_line_order: {}, line_heading_deg: {}, line_spacing_m: {}, turn_radius_m: {} };
    const planners = [{ name: "lawnmower", options: { properties } }] as unknown as PlannerView[];
    expect(shownOptions(planned(), planners)).toContain("keep_line_order");
    expect(expertOptions(planned(), planners)).not.toContain("keep_line_order");
    expect(expertOptions(surveyed({ planner: "lawnmower" }), planners)).toContain("line_spacing_m");
  });

  it("are of no concern to other planners, and to searches", () => {
    expect(linesOf({ ...planned(), planner: "cao" })).toEqual([]);
    expect(toMission({ ...planned(), planner: "cao" }).survey_lines).toBeUndefined();
    expect(linesOf({ ...planned(), kind: "search" })).toEqual([]);
  });

  it("can be flown for a length that is said instead, and be taken away", () => {
    const draft = { ...planned(), ...withLength("minutes", planned()), minutes: "7" };
    expect(lengthChoiceOf(draft)).toBe("minutes");
    expect(toMission(draft).budget).toEqual({ minutes: 7 });
    expect(lengthChoiceOf({ ...draft, ...withLength("lines", draft) })).toBe("lines");
    const without = toMission({ ...planned(), ...withoutLines });
    expect(without.survey_lines).toBeUndefined();
  });

  it("come back in a copy and in a file, but not in a template for elsewhere", () => {
    const mission = toMission(planned());
    const described = draftIn("basin.json", missionFile(mission));
    expect(linesOf(described)).toEqual(LINES);
    expect(toMission(described).survey_lines).toEqual(LINES);
    const shown = { name: "Basin", spec: { ...mission, tide: {}, planner: mission.planner } };
    expect(copyOf(shown as unknown as Parameters<typeof copyOf>[0]).lines).toEqual(LINES);
    expect(withTemplate({ mission }, surveyed()).lines).toEqual([]);
    expect(withTemplate({ mission: toMission(surveyed()) }, planned()).lines).toEqual(LINES);
  });

  it("are divided between blocks", () => {
    const all = [...LINES, line("201", WEST + 2.5 * STEP)];
    const first = surveyed();
    const draft = { ...first, ...withLines(first, all) };
    const both = { ...draft, ...withAreas(draft, [square(WEST + 2 * STEP)]) };
    expect(flownBlocks(both)).toHaveLength(2);
    expect(toMissions(both).map((one) => one.survey_lines?.map(({ name }) => name))).toEqual([
      ["101", "102"],
      ["201"],
    ]);
  });

  it("lie elsewhere than an area that none of them reaches", () => {
    expect(liesElsewhere(surveyed(), square(WEST), LINES)).toBe(false);
    expect(liesElsewhere(surveyed(), square(WEST + 3 * STEP), LINES)).toBe(true);
    // A drawn one that they cross was chosen; what is typed may be what every form begins with.
    const beside = square(WEST + 0.0005);
    expect(liesElsewhere({ source: "drawn" }, beside, LINES)).toBe(false);
    expect(liesElsewhere({ source: "typed" }, beside, LINES)).toBe(true);
    expect(liesElsewhere({ source: "typed" }, square(WEST), LINES)).toBe(false);
    // The service says what is wrong with them: lines of its own it must not lay instead.
    const elsewhere = { ...planned(), ring: square(WEST + 3 * STEP) };
    expect(toMission(elsewhere).survey_lines).toEqual(LINES);
  });

  it("come from a file as it has them", () => {
    const [first] = LINES;
    const found = { name: "101", coordinates: first?.coordinates as LngLat[], length_m: 111 };
    expect(linesIn({ lines: [found], areas: [], around: null, notes: [] })).toEqual([first]);
    expect(SPEC["survey_lines.keep_direction"].default).toBe(false);
  });
});
