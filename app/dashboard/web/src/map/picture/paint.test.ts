import { describe, expect, it } from "vitest";
import { certaintyFor, strengthOf } from "./certainty";
import { hillshade } from "./hillshade";
import { cellsIn, type Painting, paint } from "./paint";
import { colourAt, DEEP, lookupTable } from "./palette";
import { ACCURATE, SOUNDED, UNKNOWN } from "./seafloor";

const VALUES = [0, 50, 100, 300, UNKNOWN, -9];

function painted(changes: Partial<Painting> = {}) {
  const values = changes.values ?? Int32Array.from(VALUES);
  return paint({
    rows: 2,
    cols: 3,
    values,
    flags: new Int32Array(6).fill(SOUNDED),
    depths: values,
    low: 0,
    high: 100,
    colours: lookupTable(DEEP),
    guesses: null,
    light: null,
    ring: [],
    ...changes,
  });
}

const at = ({ pixels, width }: ReturnType<typeof painted>, x: number, y: number) => [
  ...pixels.subarray(4 * (y * width + x), 4 * (y * width + x) + 4),
];
const rgb = (value: number) => [...colourAt(DEEP, value, 0, 100).map(Math.round), 255];

describe("a painted layer", () => {
  it("has the northern row first and leaves unknown cells out", () => {
    const picture = painted();
    expect([picture.width, picture.height]).toEqual([3, 2]);
    expect(at(picture, 0, 1)).toEqual(rgb(0));
    expect(at(picture, 2, 1)).toEqual(rgb(100));
    expect(at(picture, 1, 0)[3]).toBe(0);
  });

  it("gives values outside the range the end's colour", () => {
    expect(at(painted(), 0, 0)).toEqual(rgb(100));
    expect(at(painted(), 2, 0)).toEqual(rgb(0));
  });

  it("is strong where it was measured, fades where it is guessed, and is empty where nothing is known", () => {
    const sds = Int32Array.from([900, 100, 200, 400, 100, 900]);
    const flags = Int32Array.from([SOUNDED, 0, 0, 0, 0, 0]);
    const { pixels } = painted({ values: new Int32Array(6), flags, guesses: { sds, full: 100, none: 800 } });
    const alpha = [3, 4, 5, 0, 1, 2].map((cell) => pixels[4 * cell + 3] as number);
    expect(alpha).toEqual([255, 255, 170, 85, 255, 0]);
  });

  it("tells apart what is guessed and less sure than asked", () => {
    const flags = Int32Array.from([SOUNDED, 0, ACCURATE, 0, 0, 0]);
    const guesses = { sds: new Int32Array(6).fill(200), full: 100, none: 800 };
    const { guessed } = painted({ flags, guesses });
    const hatched = [3, 4, 5, 0, 1, 2].map((cell) => guessed?.[4 * cell + 3]);
    expect(hatched).toEqual([0, 255, 0, 255, 0, 255]);
    expect(painted().guessed).toBeNull();
  });

  it("reaches over the cells that the area's edge cuts, not into unknown ones inside it", () => {
    const values = Int32Array.from([UNKNOWN, 100, UNKNOWN, UNKNOWN, 100, 100]);
    const ring = [
      [1, 0],
      [3, 0],
      [3, 2],
      [1, 2],
    ] as const;
    const picture = painted({ values, ring });
    expect(at(picture, 0, 1)).toEqual(rgb(100));
    expect(at(picture, 2, 1)[3]).toBe(0);
    expect([...cellsIn(ring, 2, 3)]).toEqual([0, 1, 1, 0, 1, 1]);
  });
});

describe("light and shadow", () => {
  const plane = (east: number, north: number) =>
    Int32Array.from({ length: 25 }, (_, i) => 1000 + east * (i % 5) + north * Math.floor(i / 5));
  const sure = new Float32Array(25).fill(1);

  it("leaves level ground as it is and lights what faces the light", () => {
    expect([...hillshade(plane(0, 0), sure, 5, 5, 200, 315)]).toEqual(Array(25).fill(1));
    // Deeper to the east: the floor faces east.
    expect(hillshade(plane(60, 0), sure, 5, 5, 200, 90)[12]).toBeGreaterThan(1.05);
    expect(hillshade(plane(60, 0), sure, 5, 5, 200, 270)[12]).toBeLessThan(0.95);
    expect(hillshade(plane(0, 60), sure, 5, 5, 200, 0)[12]).toBeGreaterThan(1.05);
  });

  it("makes no cliff at the edge of what is known", () => {
    const patch = plane(0, 0).map((depth, i) => (i % 5 < 2 ? depth + 3000 : depth));
    const unsure = Float32Array.from({ length: 25 }, (_, i) => (i % 5 < 2 ? 1 : 0));
    expect([...hillshade(patch, unsure, 5, 5, 200, 315)]).toEqual(Array(25).fill(1));
  });
});

it("a guess fades from the asked accuracy on, until it could have nearly any colour", () => {
  expect(certaintyFor(0.25, { low: 0, high: 2 })).toEqual({ full_m: 0.25, none_m: 1 });
  expect(certaintyFor(0.25, { low: 5, high: 35 })).toEqual({ full_m: 0.25, none_m: 6 });
  expect([0.1, 0.25, 0.5, 1, 7].map((sd) => strengthOf(sd, 0.25, 1))).toEqual([1, 1, 0.5, 0, 0]);
});
