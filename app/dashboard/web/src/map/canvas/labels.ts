/** On which side of its sign each label is written, so that labels cover neither each other nor what lies over the map. Pure. */

import type { Pixel } from "./polylines";

export interface Box {
  left: number;
  top: number;
  right: number;
  bottom: number;
}

export const SIDES = ["right", "left", "above", "below"] as const;
export type Side = (typeof SIDES)[number];

export interface Label {
  at: Pixel;
  width: number;
  height: number;
  /** From the sign's middle to its edge. */
  reach: number;
  /** Where it was before: it stays while that is as good as any other. */
  side: Side;
}

export function boxOf({ at: [x, y], width, height, reach }: Omit<Label, "side">, side: Side): Box {
  const left = side === "right" ? x + reach : side === "left" ? x - reach - width : x - width / 2;
  const top = side === "above" ? y - reach - height : side === "below" ? y + reach : y - height / 2;
  return { left, top, right: left + width, bottom: top + height };
}

/** How much worse it is to be covered than to touch another label. */
const UNSEEN = 3;

const common = (a: Box, b: Box) =>
  Math.max(0, Math.min(a.right, b.right) - Math.max(a.left, b.left)) *
  Math.max(0, Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top));

/** What signs and labels cover. */
export const boxesOf = (labels: readonly Label[], sides: readonly Side[]): Box[] =>
  labels.flatMap((label, i) => [signOf(label), boxOf(label, sides[i] ?? label.side)]);

export const signOf = ({ at: [x, y], reach }: Label): Box => ({
  left: x - reach,
  top: y - reach,
  right: x + reach,
  bottom: y + reach,
});

/** Sides for words of signs that stand there anyway, the most important first: where they cover nothing; null: nowhere. */
export const fitting = (labels: readonly Label[], taken: readonly Box[], width: number, height: number) =>
  sidesOf(labels, taken, width, height, () => []);

/** The same for names whose signs, too, are only there where they cover nothing. */
export const namesFitting = (
  labels: readonly Label[],
  taken: readonly Box[],
  width: number,
  height: number,
) => sidesOf(labels, taken, width, height, (label) => [signOf(label)]);

function sidesOf(
  labels: readonly Label[],
  taken: readonly Box[],
  width: number,
  height: number,
  newBoxes: (label: Label) => Box[],
): (Side | null)[] {
  const all = [...taken];
  return labels.map((label) => {
    const signs = newBoxes(label);
    const side = signs.every((box) => isFree(box, all)) ? freeSide(label, all, width, height) : null;
    if (side) all.push(...signs, boxOf(label, side));
    return side;
  });
}

const isFree = (box: Box, taken: readonly Box[]) => taken.every((other) => common(box, other) === 0);

function freeSide(label: Label, taken: readonly Box[], width: number, height: number): Side | null {
  const within = ({ left, top, right, bottom }: Box) =>
    left >= 0 && top >= 0 && right <= width && bottom <= height;
  const sides = [label.side, ...SIDES].filter((side) => within(boxOf(label, side)));
  return sides.find((side) => isFree(boxOf(label, side), taken)) ?? null;
}

/** Sides for labels, the most important first; `covers` are not to be written under, nor the edge of the window over. */
export function placed(
  labels: readonly Label[],
  covers: readonly Box[],
  width: number,
  height: number,
): Side[] {
  const signs = labels.map(signOf);
  const taken: Box[] = [];
  return labels.map((label, i) => {
    const others = signs.filter((_, k) => k !== i);
    const hidden = (side: Side) => {
      const box = boxOf(label, side);
      const seen = { left: 0, top: 0, right: width, bottom: height };
      const beyond = label.width * label.height - common(box, seen);
      // Under a cover nobody reads it; what two signs share can be told apart.
      const unseen = covers.reduce((sum, cover) => sum + common(box, cover), beyond);
      return [...taken, ...others].reduce((sum, other) => sum + common(box, other), UNSEEN * unseen);
    };
    const sides = [label.side, ...SIDES.filter((side) => side !== label.side)];
    const best = sides.reduce((a, b) => (hidden(b) < hidden(a) - 1 ? b : a));
    taken.push(boxOf(label, best));
    return best;
  });
}
