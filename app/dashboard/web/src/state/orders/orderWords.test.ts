import { expect, test } from "vitest";
import type { OrderView, VehicleView } from "../../api/types";
import { nearestTo, orderWords, spacingOf, takesOrders } from "./orderWords";

const order = (changes: Partial<OrderView>): OrderView => ({
  id: 1,
  vehicle: "a",
  kind: "go",
  state: "flying",
  way: [],
  asked_by: "Ana",
  asked_at: "2026-06-01T10:00:00Z",
  changed_at: "2026-06-01T10:00:00Z",
  reason: "",
  ...changes,
});
const vehicle = (name: string, lat_deg: number | null, changes: Partial<VehicleView> = {}) =>
  ({ name, active: true, withdrawn: "", lon_deg: -8.7, lat_deg, ...changes }) as VehicleView;
const running = { state: "running", ending: null };

test("an order is one line, with who gave it", () => {
  expect(orderWords(order({}))).toBe("Goes where it was sent: ordered by Ana");
  expect(orderWords(order({ kind: "skip-line", state: "accepted" }))).toBe(
    "Leaves out the rest of its line, next: ordered by Ana",
  );
  const way: [number, number][] = [
    [-8.7, 41.18],
    [-8.7, 41.181],
  ];
  expect(orderWords(order({ kind: "denser", way }))).toBe(
    "Surveys a part denser, 1 line, 111 m: ordered by Ana",
  );
});

test("who surveys can be sent, the nearest first", () => {
  const found = nearestTo([-8.7, 41.18], running, [
    vehicle("far", 41.19),
    vehicle("near", 41.1801),
    vehicle("held", 41.18, { withdrawn: "held by Ana" }),
    vehicle("unheard", null),
  ]);
  expect(found.map(({ name }) => name)).toEqual(["near", "far"]);
  expect(takesOrders({ state: "paused", ending: null }, vehicle("a", 41.18))).toBe(false);
  expect(takesOrders({ state: "running", ending: "finished" }, vehicle("a", 41.18))).toBe(false);
});

test("how far apart lines are to be is typed with a point or a comma, or not at all", () => {
  expect(["", " 2.5", "2,5", "0,5"].map(spacingOf)).toEqual([null, 2.5, 2.5, 0.5]);
  expect(["0.4", "-1", "two"].map(spacingOf)).toEqual([undefined, undefined, undefined]);
});
