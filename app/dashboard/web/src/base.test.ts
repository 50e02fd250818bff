/** Whether words and the edges of fields can be told from what they stand on (WCAG 2.2, 1.4.3 and 1.4.11), in all colours. */

import { readFileSync } from "node:fs";
import { join } from "node:path";
import { describe, expect, it } from "vitest";

const CSS = readFileSync(join(import.meta.dirname, "base.css"), "utf8");

type Colours = Record<string, string>;

/** The variables of a rule that are colours; of two, that of the dark look or the light one. */
function coloursOf(selector: string, dark: boolean): Colours {
  const [, rule = ""] = CSS.split(`\n${selector} {`);
  const [body = ""] = rule.split("\n}");
  const found = [...body.matchAll(/--([\w-]+): (?:light-dark\((#\w{6}), (#\w{6})\)|(#\w{6}));/g)];
  return Object.fromEntries(
    found.map(([, name, light, night, one]) => [name, one ?? (dark ? night : light)] as [string, string]),
  );
}

const root = (dark: boolean) => coloursOf(":root", dark);
const THEMES: Record<string, Colours> = {
  light: root(false),
  dark: root(true),
  contrast: { ...root(false), ...coloursOf(':root[data-theme="contrast"]', false) },
  night: { ...root(true), ...coloursOf(':root[data-theme="night"]', true) },
};

const RED = 0.2126;
const GREEN = 0.7152;
const BLUE = 0.0722;

function luminance(colour: string): number {
  const [r, g, b] = [1, 3, 5].map((at) => {
    const part = Number.parseInt(colour.slice(at, at + 2), 16) / 255;
    return part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4;
  }) as [number, number, number];
  return RED * r + GREEN * g + BLUE * b;
}

function contrast(a: string, b: string): number {
  const [dark, light] = [luminance(a), luminance(b)].sort((one, other) => one - other) as [number, number];
  return (light + 0.05) / (dark + 0.05);
}

const WORDS = ["ink", "ink-2", "accent", "good", "warning", "alarm"];
const PAPERS = ["paper", "paper-2"];
const pairs = (fronts: readonly string[], grounds: readonly string[]) =>
  fronts.flatMap((front) => grounds.map((ground) => [front, ground] as const));

describe.each(Object.entries(THEMES))("in the colours %s", (_, colours) => {
  const low = (found: readonly (readonly [string, string])[], least: number) =>
    found
      .map(([front, ground]) => ({ pair: `${front} on ${ground}`, front, ground }))
      .map(
        ({ pair, front, ground }) => [pair, contrast(colours[front] ?? "", colours[ground] ?? "")] as const,
      )
      .filter(([, found]) => !(found >= least))
      .map(([pair, found]) => `${pair} ${found.toFixed(2)}`);

  it("words can be read", () => {
    const words = [
      ...pairs(WORDS, PAPERS),
      // A field's own, and what stands in it as long as nothing is typed.
      ...pairs(["ink", "ink-2"], ["field", "chosen"]),
      ...pairs(["ink", "warning"], ["warning-paper"]),
      ...pairs(["ink", "alarm"], ["alarm-paper"]),
      ...pairs(["on-accent"], ["accent"]),
      ...pairs(["on-abort"], ["abort"]),
    ];
    expect(low(words, 4.5)).toEqual([]);
  });

  it("a field's edge can be seen", () => {
    expect(low(pairs(["field-rule"], ["field", ...PAPERS]), 3)).toEqual([]);
  });
});

it("what stands in an empty field has a colour of the page", () => {
  expect(CSS).toMatch(/::placeholder \{\n {2}color: var\(--ink-2\);\n {2}opacity: 1;\n\}/);
});
