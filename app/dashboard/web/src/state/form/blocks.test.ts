import { describe, expect, it } from "vitest";
import type { LngLat, NewMission, PlanView } from "../../api/types";
import { ringOf } from "../../map/area";
import {
  atBlock,
  comingFrom,
  earlier,
  faultInBlock,
  inAll,
  inSequence,
  type PlannedVehicle,
  renamed,
  toMissions,
  withAnother,
  withAreas,
  withoutBlock,
} from "./blocks";
import { allBlocks, blockTitle, type Draft, emptyDraft, faultsOf } from "./draft";
import { draftIn, missionFile } from "./missionFile";

const square = (west: number): LngLat[] => [
  [west, 41],
  [Math.round((west + 0.001) * 1e3) / 1e3, 41],
  [Math.round((west + 0.001) * 1e3) / 1e3, 41.001],
  [west, 41.001],
];
const [WEST, MIDDLE, EAST] = [square(-9), square(-8.99), square(-8.98)];
const drawn = (changes: Partial<Draft> = {}): Draft => ({
  ...emptyDraft([-9, 41]),
  name: "Bay",
  source: "drawn",
  ring: WEST,
  ...changes,
});
const changed = (draft: Draft, how: (draft: Draft) => Partial<Draft>): Draft => ({ ...draft, ...how(draft) });
/** West, middle and east; the fields describe the middle one. */
const three = drawn({
  ring: MIDDLE,
  block_name: "Middle",
  turn: 1,
  blocks: [
    { name: "West", ring: WEST },
    { name: "", ring: EAST },
  ],
});
const names = (draft: Draft) => allBlocks(draft).map(blockTitle);

describe("blocks", () => {
  it("are one mission each, in their order, and called by their names", () => {
    const made = toMissions(three);
    expect(made.map(({ name }) => name)).toEqual(["Bay – West", "Bay – Middle", "Bay – Block 3"]);
    expect(made.map(({ area }) => ringOf(area))).toEqual([WEST, MIDDLE, EAST]);
    expect(toMissions(drawn()).map(({ name }) => name)).toEqual(["Bay"]);
  });

  it("let vehicles go home after the last one only", () => {
    const homing = { ...three, recovery: "41.0005, -8.9895" };
    expect(toMissions(homing).map(({ recovery }) => recovery?.on_finish)).toEqual(["stop", "stop", "return"]);
  });

  it("have lines as far apart each, where that is what the length is given by", () => {
    const spaced = {
      ...three,
      spacing_m: "10",
      blocks: [
        {
          name: "Small",
          ring: [
            [-9, 41],
            [-8.9995, 41],
            [-8.9995, 41.001],
            [-9, 41.001],
          ] as LngLat[],
        },
      ],
    };
    const [small, middle] = toMissions(spaced).map(({ budget }) => budget?.km_per_vehicle as number);
    expect(middle as number).toBeCloseTo(2 * (small as number), 1);
  });

  it("are described one at a time", () => {
    const east = changed(three, (draft) => atBlock(draft, 2));
    expect([east.ring, east.block_name, east.turn]).toEqual([EAST, "", 2]);
    expect(names(east)).toEqual(names(three));
    expect(atBlock(three, 1)).toEqual({});
  });

  it("come one after the other: to be drawn, or typed beside the last one", () => {
    const next = changed(drawn(), withAnother);
    expect([next.ring, next.turn, next.blocks.length]).toEqual([[], 1, 1]);
    expect(faultsOf(next).ring).not.toBe("");
    const typed = changed({ ...emptyDraft([-9, 41]), name: "Bay" }, withAnother);
    const [first, second] = allBlocks(typed).map(({ ring }) => ring.map(([lng]) => lng));
    expect(Math.min(...(second as number[]))).toBeGreaterThan(Math.max(...(first as number[])));
    expect(names(changed(drawn(), (draft) => withAreas(draft, [MIDDLE, EAST])))).toEqual([
      "Block 1",
      "Block 2",
      "Block 3",
    ]);
  });

  it("are reordered, renamed and removed, and the fields stay with theirs", () => {
    const moved = changed(three, (draft) => earlier(draft, 2));
    expect(names(moved)).toEqual(["West", "Block 2", "Middle"]);
    expect([moved.turn, moved.ring]).toEqual([2, MIDDLE]);
    const first = changed(three, (draft) => earlier(draft, 1));
    expect([first.turn, names(first)[0]]).toEqual([0, "Middle"]);
    expect(names(changed(three, (draft) => renamed(draft, 0, "Mole")))[0]).toBe("Mole");
    expect(names(changed(three, (draft) => renamed(draft, 1, "Basin")))[1]).toBe("Basin");
    const fewer = changed(three, (draft) => withoutBlock(draft, 0));
    expect([names(fewer), fewer.turn, fewer.ring]).toEqual([["Middle", "Block 2"], 0, MIDDLE]);
    const other = changed(three, (draft) => withoutBlock(draft, 1));
    expect([names(other), other.turn, other.ring]).toEqual([["West", "Block 2"], 1, EAST]);
  });

  it("are all checked, and a search has none", () => {
    const crossed = [WEST[0], WEST[2], WEST[1], WEST[3]] as LngLat[];
    expect(faultsOf({ ...three, blocks: [{ name: "", ring: crossed }] }).blocks).toContain("crosses itself");
    const faulty = {
      ...drawn(),
      turn: 1,
      blocks: [
        { name: "Quay", ring: crossed },
        { name: "", ring: [] },
      ],
    };
    expect(faultsOf(faulty).blocks).toMatch(/^Quay: .*crosses itself/);
    expect(faultsOf({ ...faulty, blocks: faulty.blocks.toReversed() }).blocks).toMatch(
      /^Block 1: An area needs/,
    );
    const search = { ...three, kind: "search" as const, goal: "41.0005, -8.9895", entry: "41.0002, -8.9898" };
    expect(toMissions(search).length).toBe(1);
  });

  it("are told apart where the service refuses the area of one", () => {
    expect(faultInBlock("ring", "on land", three, 2)).toEqual(["blocks", "Block 3: on land"]);
    expect(faultInBlock("ring", "on land", three, three.turn)).toEqual(["ring", "on land"]);
    expect(faultInBlock("steps", "too many", three, 2)).toEqual(["steps", "too many"]);
    // A search has the marked one alone.
    expect(faultInBlock("ring", "on land", { ...three, turn: 1, kind: "search" }, 0)).toEqual([
      "ring",
      "on land",
    ]);
  });

  it("are kept in a mission's file", () => {
    const [mission] = toMissions(drawn());
    const read = draftIn("bay.json", missionFile(mission as never, "", allBlocks(three)));
    expect(allBlocks(read)).toEqual(allBlocks(three));
    expect(missionFile(mission as never, "", allBlocks(drawn()))).not.toContain("blocks");
  });
});

describe("the plan of a block", () => {
  it("begins where the vehicles end the one before", () => {
    const [west, middle] = toMissions(three) as [NewMission, NewMission];
    expect(comingFrom(undefined, west)).toEqual(west);
    const before = {
      vehicles: [
        {
          vehicle: "sim-1",
          way: [
            [-9, 41],
            [-9, 41.001],
          ],
        },
      ],
    } as unknown as PlanView;
    const asked = comingFrom(before, middle);
    expect(asked.after).toBe("planned");
    expect(asked.vehicles.map(({ start }) => start)).toEqual([[-9, 41.001], undefined]);
  });
});

describe("blocks on one battery", () => {
  const plan = (distance_m: number, duration_s: number, home_s: number, left_s: number | null): PlanView =>
    ({
      distance_m,
      vehicles: [
        {
          vehicle: "sim-1",
          distance_m,
          duration_s,
          duration_s_range: { low: duration_s - 10, high: duration_s + 10 },
          energy_needs_s: duration_s + home_s,
          energy_left_s: left_s,
          home_s,
          turn_back_m: null,
        },
      ],
    }) as unknown as PlanView;
  const parts = (...plans: PlanView[]) =>
    inSequence(plans).map(({ vehicles }) => vehicles[0] as PlannedVehicle);

  it("have left what the blocks before did not use, and sums that say so", () => {
    const [first, second] = parts(plan(1000, 600, 100, 2000), plan(500, 300, 50, 2000));
    expect([first?.energy_left_s, second?.energy_left_s]).toEqual([2000, 1400]);
    expect(second?.turn_back_m).toBeNull();
    expect(inAll([first, second] as PlannedVehicle[])).toMatchObject({
      distance_m: 1500,
      duration_s_range: { low: 880, high: 920 },
      energy_left_s: 2000,
      energy_needs_s: 950,
      home_s: 50,
      turn_back_m: null,
    });
  });

  it("turn back in the one in which it ends", () => {
    const [first, second] = parts(plan(1000, 600, 100, 800), plan(500, 300, 50, 800));
    expect(first?.turn_back_m).toBeNull();
    // 200 s are left, of which 100 are for the way home.
    expect(second?.turn_back_m).toBeCloseTo(500 / 3);
    expect(inAll([first, second] as PlannedVehicle[])?.turn_back_m).toBeCloseTo(1000 + 500 / 3);
  });

  it("are not said to last where that is not known", () => {
    const [first, second] = parts(plan(1000, 600, 100, null), plan(500, 300, 50, null));
    expect([first?.energy_left_s, second?.energy_left_s, second?.turn_back_m]).toEqual([null, null, null]);
    expect(inAll([])).toBeUndefined();
  });
});
