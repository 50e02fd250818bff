import { describe, expect, it } from "vitest";
import { type Draft, emptyDraft, faultsOf, simulatedNames, vehicleNames } from "./draft";
import { withVehicleCalled } from "./vehicles";

const draft: Draft = {
  ...emptyDraft([-8.705, 41.185]),
  name: "Quay",
  chosen: [
    { name: "auv-1", kind: "imc", sensor: "dvl" },
    { name: "auv-10", kind: "imc", sensor: "dvl" },
  ],
  own: {
    "auv-1": { endurance_min: "50", speed_mps: "1" },
    "auv-10": { endurance_min: "200", speed_mps: "2" },
    "sim-1": { endurance_min: "70" },
    "sim-2": { endurance_min: "80" },
  },
};
function called(from: Draft, ...names: [place: number, name: string][]): Draft {
  let made = from;
  for (const [place, name] of names) made = { ...made, ...withVehicleCalled(made, place, name) };
  return made;
}

describe("a vehicle that is called otherwise", () => {
  it("keeps what it has of its own, and nobody else has it", () => {
    const made = called(draft, [1, "auv-12"], [3, "south"]);
    expect(vehicleNames(made)).toEqual(["auv-1", "auv-12", "sim-1", "south"]);
    const { "auv-10": ten, "sim-2": two, ...others } = draft.own;
    expect(made.own).toEqual({ ...others, "auv-12": ten, south: two });
    expect(faultsOf(made)).toEqual({});
  });

  it("takes no name from another one, nor what that one has", () => {
    const clash = called(draft, [3, "sim-1"]);
    expect(faultsOf(clash).names).toContain("Two vehicles are called sim-1");
    expect(called(clash, [3, "x3"]).own).toEqual({
      "auv-1": draft.own["auv-1"],
      "auv-10": draft.own["auv-10"],
      "sim-1": { endurance_min: "70" },
      x3: { endurance_min: "80" },
    });
    expect(faultsOf(called(clash, [3, "sim-2"]))).toEqual({});
  });

  it("gets the name that it waits for as soon as that is free", () => {
    const made = called(draft, [1, "auv-1"], [0, "auv-2"]);
    expect(made.chosen.map(({ name }) => name)).toEqual(["auv-2", "auv-1"]);
    expect([made.own["auv-2"]?.endurance_min, made.own["auv-1"]?.endurance_min]).toEqual(["50", "200"]);
    expect(faultsOf(made)).toEqual({});
  });

  it("does not take over what a vehicle had that is gone", () => {
    const left = { ...draft, chosen: draft.chosen.slice(0, 1) };
    expect(called(left, [1, "auv-10"]).own["auv-10"]).toEqual({ endurance_min: "70" });
    expect(called({ ...left, simulated: "3" }, [3, "auv-10"]).own["auv-10"]).toBeUndefined();
  });
});

it.each([
  ["5000", 100],
  ["1e999", 0],
  ["2.5", 0],
  ["-1", 0],
  ["", 0],
])("%j simulated vehicles are %i while that is typed", (simulated, count) => {
  expect(simulatedNames({ ...draft, simulated })).toHaveLength(count);
});
