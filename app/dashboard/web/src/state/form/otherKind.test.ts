import { describe, expect, it } from "vitest";
import type { MissionView } from "../../api/types";
import { copyOf, type Draft, emptyDraft, faultsOf, toMission, turnedInto } from "./draft";

const places = { goal: "41.1853, -8.7045", entry: "41.1851, -8.7049" };
const fresh = (kind: Draft["kind"]): Draft => {
  const empty = emptyDraft([-8.705, 41.185]);
  return { ...empty, ...turnedInto(kind, empty), name: "Quay" };
};
/** A mission that was created without a word on anything that has a default, as the service shows it. */
const shown = (kind: Draft["kind"], changes: object = {}): Pick<MissionView, "name" | "spec"> => {
  const isSearch = kind === "search";
  const made = toMission({ ...fresh(kind), ...places });
  const spec = {
    ...made,
    search: made.search ?? null,
    planner: { name: isSearch ? "rollout" : "cao", options: { candidates: 64 } },
    budget: { steps: isSearch ? 1800 : 100 },
    arrival_radius_m: isSearch ? 1 : 3,
    limits: { ...made.limits, keep_out_margin_m: isSearch ? 2 : 10, border_margin_m: 1 },
    tide: { level_m: 0, source: "none applied" },
    vehicles: made.vehicles.map((vehicle) => ({ ...vehicle, depth_m: isSearch ? 0 : null })),
    recovery: null,
    site: null,
    seed: 7,
    ...changes,
  };
  return { name: "Quay", spec: spec as unknown as MissionView["spec"] };
};
const turned = (to: Draft["kind"], from: ReturnType<typeof shown>): Draft => {
  const copy = copyOf(from);
  return { ...copy, ...turnedInto(to, copy), ...places, name: "Quay" };
};
/** Without what no kind of mission has for itself. */
const own = ({ seed: _, area: _a, keep_out: _k, tide: _t, ...mission }: Record<string, unknown>) => {
  const { border_margin_m: _b, ...limits } = mission.limits as Record<string, unknown>;
  return { ...mission, limits };
};

describe("a copy of another kind", () => {
  it.each([
    ["search", "survey"],
    ["survey", "search"],
  ] as const)("is as a new %s where only the %s had it so", (to, from) => {
    const draft = turned(to, shown(from));
    const made = toMission(draft) as unknown as Record<string, unknown>;
    expect(faultsOf(draft)).toEqual({});
    const asNew = toMission({ ...fresh(to), ...places }) as unknown as Record<string, unknown>;
    expect(own(made)).toEqual(own(asNew));
    expect([made.seed, (made.limits as Record<string, unknown>).border_margin_m]).toEqual([7, 1]);
  });

  it("keeps what somebody asked for", () => {
    const survey = shown("survey");
    const limits = { ...survey.spec.limits, keep_out_margin_m: 25 };
    const made = toMission(turned("search", shown("survey", { limits, arrival_radius_m: 1.5 })));
    expect(made).toMatchObject({ arrival_radius_m: 1.5, limits: { keep_out_margin_m: 25 } });
  });

  it("has as many steps as there were only where the search is as long as it was", () => {
    const draft = copyOf(shown("search"));
    expect(toMission(draft).budget).toEqual({ steps: 1800 });
    for (const longer of [{ window_min: "60" }, { speed_mps: "2" }, { max_step_m: "5" }])
      expect(toMission({ ...draft, ...longer })).not.toHaveProperty("budget");
  });

  it("is what it was after a change there and back", () => {
    const search = shown("search");
    const there = turned("survey", search);
    const back = { ...there, ...turnedInto("search", there) };
    expect(toMission(back)).toEqual(toMission({ ...copyOf(search), ...places, name: "Quay" }));
  });
});
