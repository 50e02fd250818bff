import { expect, it } from "vitest";
import { recoveryMarks, waitingCircle, wayHome } from "./recovery";

const point = [-8.7, 41.2] as const;
const own = [-8.6, 41.1] as const;

it("the mission's recovery point and a vehicle's own are marked with their radius", () => {
  const vehicles = [{ name: "sim-1" }, { name: "sim-2", recovery_point: own }];
  expect(recoveryMarks({ recovery: { point, radius_m: 40 }, vehicles }, 25)).toEqual([
    { words: "Recovery", sign: "home", at: point, radius_m: 40 },
    { words: "Recovery of sim-2", sign: "home", at: own, radius_m: 40 },
  ]);
  expect(recoveryMarks({ recovery: null, vehicles }, 25).map(({ radius_m }) => radius_m)).toEqual([25]);
});

it("a way home begins where the vehicle is, and one that left, is there or was never heard has none", () => {
  const out = { active: true, lon_deg: -8.65, lat_deg: 41.15, way_home: [own, point] };
  expect(wayHome(out, "red")).toEqual([{ points: [[-8.65, 41.15], own, point], colour: "red" }]);
  for (const change of [{ active: false }, { lon_deg: null }, { way_home: [] }]) {
    expect(wayHome({ ...out, ...change }, "red")).toEqual([]);
  }
});

it("is a circle where a vehicle was sent to wait", () => {
  const circle = { centre: [-8.7, 41.1], radius_m: 12.5 } as const;
  const waiting = { active: true, waiting_circle: circle };
  expect(waitingCircle(waiting, "red")).toEqual([{ at: [-8.7, 41.1], radius_m: 12.5, colour: "red" }]);
  expect(waitingCircle({ ...waiting, active: false }, "red")).toEqual([]);
  expect(waitingCircle({ ...waiting, waiting_circle: null }, "red")).toEqual([]);
});
