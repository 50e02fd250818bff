import { describe, expect, it } from "vitest";
import { stepAfter, TOUR, type TourFacts } from "./tour";

const BEGUN: TourFacts = {
  state: "ready",
  checking: false,
  soundings: 0,
  mapped: false,
  layer: "depth",
  held: 0,
  resumed: false,
  corners: 0,
  tab: null,
};
const at = (step: number) => TOUR[step]?.name;

describe("the guided first mission", () => {
  it("goes on by what is really done, one thing after the other", () => {
    const happens: Partial<TourFacts>[] = [
      { checking: true },
      { checking: false, state: "running" },
      { mapped: true },
      { layer: "uncertainty" },
      { held: 1 },
      { held: 0, resumed: true },
      { corners: 2, tab: "profile" },
      { state: "finished" },
      { tab: "files" },
    ];
    let facts = BEGUN;
    let step = 0;
    const walked = happens.map((change) => {
      facts = { ...facts, ...change };
      step = stepAfter(step, facts);
      return at(step);
    });
    expect(walked).toEqual([
      "start",
      "watch",
      "layer",
      "hold",
      "resume",
      "profile",
      "finish",
      "files",
      undefined,
    ]);
  });

  it("stays where nothing was done, and never goes back", () => {
    expect(stepAfter(0, BEGUN)).toBe(0);
    expect(at(stepAfter(3, { ...BEGUN, state: "running", mapped: true }))).toBe("layer");
  });

  it("passes over what a mission that has ended cannot do any more", () => {
    const over = { ...BEGUN, state: "aborted", layer: "uncertainty" };
    expect(at(stepAfter(1, over))).toBe("profile");
    expect(at(stepAfter(6, { ...over, corners: 2, tab: "profile" }))).toBe("files");
  });
});
