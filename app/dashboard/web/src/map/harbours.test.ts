import { readFileSync } from "node:fs";
import { join } from "node:path";
import { describe, expect, it } from "vitest";
import { seenOf } from "./canvas/harbourNames";
import { Projection } from "./canvas/projection";
import { harboursNamed, harboursOf } from "./harbours";

const ALL = harboursOf(readFileSync(join(import.meta.dirname, "harbours.tsv"), "utf8"));
const names = (text: string, most = 7) => harboursNamed(ALL, text, most).map(({ name }) => name);

it("every harbour has a place on earth, a name and a country, the largest first", () => {
  expect(ALL.length).toBeGreaterThan(3000);
  const wrong = ALL.filter(
    ({ size, at, name, country }) =>
      ![0, 1, 2, 3].includes(size) || !(Math.abs(at[0]) <= 180 && Math.abs(at[1]) < 90) || !name || !country,
  );
  expect(wrong).toEqual([]);
  const sizes = ALL.map(({ size }) => size);
  expect(sizes).toEqual([...sizes].sort((a, b) => b - a));
});

describe("a harbour is found", () => {
  it("by the beginning of its name or of a word of it, large ones first, with accents and without", () => {
    expect(names("lisb")[0]).toBe("Lisboa");
    expect(names("Leixões")).toEqual(["Porto De Leixoes"]);
    expect(names("porto", 40)).toContain("Porto De Leixoes");
    expect(names("rotter")[0]).toBe("Rotterdam");
  });

  it("by another name, after those that are called so", () => {
    expect(names("matosinhos")).toEqual(["Porto De Leixoes"]);
    expect(names("Leghorn")).toEqual(["Livorno"]);
  });

  it("not by a single letter or by nothing", () => {
    expect(names("l")).toEqual([]);
    expect(names("  ")).toEqual([]);
    expect(names("no such harbour")).toEqual([]);
  });
});

describe("a window shows", () => {
  const seen = (zoom: number) => seenOf(ALL, new Projection({ centre: [-8.7, 41.18], zoom }, 1200, 800));

  it("the largest harbours of half a continent, all of a coast, and none of a survey", () => {
    expect(seen(4).every(({ size }) => size === 3)).toBe(true);
    expect(seen(4).length).toBeGreaterThan(3);
    expect(seen(10).map(({ name }) => name)).toContain("Porto De Leixoes");
    expect(seen(12)).toEqual([]);
  });

  it("never more than can be read", () => {
    for (const zoom of [2, 4, 5, 6, 7, 8, 9, 10, 11]) expect(seen(zoom).length).toBeLessThan(30);
  });
});
