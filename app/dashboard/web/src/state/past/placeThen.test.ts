import { expect, test } from "vitest";
import type { StepView } from "../../api/types";
import { placeThen, stepAt, vehicleOf } from "./placeThen";

const step = (number: number, committed_at: string, lat_deg: number) =>
  ({
    number,
    committed_at,
    waypoints: [{ vehicle: "a", lon_deg: -8.7, lat_deg, depth_m: 2, status: "reached", arrival_radius_m: 3 }],
  }) as unknown as StepView;
const steps = [step(1, "2026-06-01T10:00:00Z", 41.18), step(2, "2026-06-01T10:00:10Z", 41.181)];
const way = {
  places: [
    [-8.7, 41.1795],
    [-8.7, 41.18],
    [-8.7, 41.1805],
    [-8.7, 41.181],
  ] as [number, number][],
  depths_m: [1, 2, 2, 2],
};

test("where a vehicle was follows from the step that was flown then", () => {
  const at = (time: string) => placeThen("a", way, steps, Date.parse(time));
  expect(at("2026-06-01T09:59:00Z")).toEqual([-8.7, 41.1795]);
  expect(at("2026-06-01T10:00:05Z")).toEqual([-8.7, 41.18]);
  expect(at("2026-06-01T11:00:00Z")).toEqual([-8.7, 41.181]);
  expect(placeThen("b", undefined, steps, Date.parse("2026-06-01T11:00:00Z"))).toBeNull();
  expect(stepAt([], 0)).toBe(-1);
});

test("a line of the log is about the vehicle that it names", () => {
  expect(vehicleOf({ data: { vehicle: "a" } })).toBe("a");
  expect(vehicleOf({ data: {} })).toBeNull();
});
