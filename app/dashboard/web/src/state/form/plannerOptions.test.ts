import { describe, expect, it } from "vitest";
import type { MissionView, PlannerView } from "../../api/types";
import { copyOf, type Draft, emptyDraft, faultsOf, toMission } from "./draft";
import { optionsOf, withPlanner } from "./plannerOptions";

const planner = (name: string, ...read: string[]) =>
  ({
    name,
    options: { properties: Object.fromEntries(read.map((one) => [one, {}])) },
  }) as unknown as PlannerView;
const PLANNERS = [
  planner("cao", "candidates", "alpha", "turn_radius_m"),
  planner("lawnmower", "turn_radius_m", "line_spacing_m"),
  planner("pcao", "turn_radius_m", "model"),
];
const draft: Draft = { ...emptyDraft([-8.705, 41.185]), name: "Quay" };

/** A mission that was sent, as the service shows it. */
const shown = (options: object, name = "cao") => {
  const spec = { ...toMission(draft), tide: {}, planner: { name, options } };
  return { name: "Quay", spec } as unknown as MissionView;
};

describe("another planner", () => {
  it("keeps the settings that it reads, too, and no others", () => {
    const set = { ...draft, options: { candidates: "64", turn_radius_m: "5" } };
    const lines = { ...set, ...withPlanner("lawnmower", set, PLANNERS) };
    expect(toMission(lines).planner).toEqual({ name: "lawnmower", options: { turn_radius_m: 5 } });
  });

  it("has none while it is not known what it reads", () => {
    expect(withPlanner("lawnmower", { options: { candidates: "64" } }, []).options).toEqual({});
  });

  it("flies without the trained controller of the one before", () => {
    const copy = copyOf(shown({ model: { kind: "pcao" }, turn_radius_m: 5 }, "pcao"));
    expect(toMission(copy).planner).toEqual({
      name: "pcao",
      options: { model: { kind: "pcao" }, turn_radius_m: 5 },
    });
    expect(toMission({ ...copy, ...withPlanner("lawnmower", copy, PLANNERS) }).planner).toEqual({
      name: "lawnmower",
      options: { turn_radius_m: 5 },
    });
  });
});

describe("settings", () => {
  it("are those that are numbers or choices", () => {
    expect(optionsOf("pcao", PLANNERS)).toEqual(["turn_radius_m"]);
  });

  it("of a copied mission are typed where they are unusual", () => {
    const copy = copyOf(
      shown({ regressors: "polynomial", degree: 1, alpha: 0.5, window: null, model: null }),
    );
    expect(copy.options).toEqual({ regressors: "polynomial", alpha: "0.5" });
    expect(toMission(copy).planner?.options).toEqual({ regressors: "polynomial", alpha: 0.5 });
  });

  it.each([
    ["degree", "abc", "degree needs a number"],
    ["search", "1 000", "search needs a number"],
    ["degree", "9", "degree must be between 1 and 3"],
    ["candidates", "48.5", "candidates needs a whole number"],
  ])("%s of '%s' is a fault beside it", (name, text, words) => {
    expect(faultsOf({ ...draft, options: { [name]: text } })).toEqual({ [`options.${name}`]: words });
  });

  it("that are empty are left to the service, and all in a search", () => {
    expect(toMission({ ...draft, options: { degree: " " } }).planner?.options).toEqual({});
    const search = { kind: "search", goal: "41.1853, -8.7045", entry: "41.1851, -8.7049" } as const;
    expect(faultsOf({ ...draft, ...search, options: { degree: "abc" } })).toEqual({});
  });
});

describe("lines at a distance", () => {
  const lines: Draft = { ...draft, planner: "lawnmower", spacing_m: "25" };

  it("are what even lines are told to fly, with way enough to end with the last one", () => {
    const { planner, budget } = toMission(lines);
    expect(planner).toEqual({ name: "lawnmower", options: { line_spacing_m: 25 } });
    const adaptive = toMission({ ...lines, planner: "cao" });
    expect(adaptive.planner?.options).toEqual({});
    expect(budget?.km_per_vehicle).toBeGreaterThan(1.3 * (adaptive.budget?.km_per_vehicle as number));
  });

  it("have way enough for lines across, and bounds of their own", () => {
    const each_km = (changes: Partial<Draft>) =>
      toMission({ ...lines, ...changes }).budget?.km_per_vehicle as number;
    expect(each_km({ crosslines_pct: "50" })).toBeGreaterThan(1.1 * each_km({ crosslines_pct: "0" }));
    expect(faultsOf({ ...lines, spacing_m: "0.2" }).spacing_m).toContain("between 0.5 and");
    expect(faultsOf({ ...lines, planner: "cao", spacing_m: "0.9" })).toEqual({});
  });

  it("have lines across all others, as full coverage has", () => {
    const spaced = { ...lines, crosslines_pct: "10" };
    expect(toMission(spaced)).toMatchObject({ coverage: { crosslines_pct: 10 } });
    expect(toMission({ ...spaced, spacing_m: "" })).not.toHaveProperty("coverage.crosslines_pct");
  });

  it("are a setting like others where the length is said otherwise", () => {
    const { planner, budget } = toMission({
      ...draft,
      planner: "lawnmower",
      length: "minutes",
      minutes: "60",
      options: { line_spacing_m: "30" },
    });
    expect(planner?.options).toEqual({ line_spacing_m: 30 });
    expect(budget).toEqual({ minutes: 60 });
  });
});
