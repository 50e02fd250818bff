import { expect, it } from "vitest";
import { boxesOf, boxOf, fitting, type Label, namesFitting, placed } from "./labels";

const label = (x: number, y: number, changes: Partial<Label> = {}): Label => ({
  at: [x, y],
  width: 60,
  height: 16,
  reach: 15,
  side: "right",
  ...changes,
});

it("a label stays where it was while nothing is in its way", () => {
  expect(placed([label(200, 200)], [], 400, 400)).toEqual(["right"]);
  expect(placed([label(200, 200, { side: "below" })], [], 400, 400)).toEqual(["below"]);
});

it("labels leave each other, other signs, covers and the window's edge alone", () => {
  const three = [label(200, 200), label(240, 200), label(380, 100)];
  const cover = { left: 100, top: 190, right: 185, bottom: 210 };
  const sides = placed(three, [cover], 400, 400);
  const boxes = three.map((one, i) => boxOf(one, sides[i] ?? "right"));
  expect(sides[2]).toBe("left");
  expect(["above", "below"]).toContain(sides[0]);
  const overlap = (a: (typeof boxes)[0], b: typeof cover) =>
    a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  expect(boxes.some((box) => overlap(box, cover))).toBe(false);
  expect(overlap(boxes[0] as (typeof boxes)[0], boxes[1] as typeof cover)).toBe(false);
});

it("where every side is taken the least hidden one is", () => {
  const everywhere = { left: 0, top: 0, right: 400, bottom: 400 };
  expect(placed([label(2, 200)], [everywhere], 400, 400)).toEqual(["right"]);
});

it("words of signs that stand there anyway are left out where they would cover another label", () => {
  const vehicle = label(200, 200, { side: "left" });
  const taken = boxesOf([vehicle], ["left"]);
  // A ship beside a vehicle: her own sign is in nobody's way, and hers are not written over the vehicle's name.
  const ship = label(150, 206, { side: "right" });
  expect(fitting([ship], taken, 400, 400)).toEqual(["above"]);
  const among = [label(100, 200), label(200, 240), label(150, 170), label(150, 240), label(110, 225)];
  expect(
    fitting(
      [ship],
      boxesOf(
        among,
        among.map(() => "right" as const),
      ),
      400,
      400,
    ),
  ).toEqual([null]);
});

it("names are written where they cover nothing, and left out with their signs elsewhere", () => {
  const taken = boxesOf([label(200, 200)], ["right"]);
  const names = [label(190, 260), label(205, 200), label(200, 262), label(30, 350)].map((one) => ({
    ...one,
    reach: 6,
  }));
  const sides = namesFitting(names, taken, 400, 400);
  expect(sides.map((side) => side !== null)).toEqual([true, false, false, true]);
});
