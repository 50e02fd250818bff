import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import ts from "typescript";
import { afterEach, describe, expect, it } from "vitest";
import { CATALOGUE } from "./catalogue";
import { NAMES } from "./names";
import { chosenLanguage, type Key, LANGUAGES, languageOf, say, sayWith } from "./say";

const ROOT = join(import.meta.dirname, "..");
const sources = (folders: readonly string[]) =>
  folders.flatMap((folder) =>
    readdirSync(join(ROOT, folder), { recursive: folder !== ".", encoding: "utf8" })
      .filter((name) => /\.tsx?$/.test(name) && !/\.test\.|\.d\.ts$/.test(name))
      .map((name) => {
        const text = readFileSync(join(ROOT, folder, name), "utf8");
        return { name: `${folder}/${name}`, text };
      }),
  );

const keys = Object.keys(CATALOGUE) as Key[];
const openPlaces = (text: string) =>
  [...new Set([...text.matchAll(/\{(\w+)/g)].map(([, name]) => name))].sort();

afterEach(() => {
  chosenLanguage.value = "system";
});

describe("the catalogue", () => {
  it("leaves the same places open in every language, and no text empty", () => {
    for (const key of keys) {
      const texts = LANGUAGES.map((one) => CATALOGUE[key][one]);
      expect(new Set(texts.map((text) => openPlaces(text).join())).size, key).toBe(1);
      expect(
        texts.every((text) => /\S/.test(text)),
        key,
      ).toBe(true);
      // What stands around a text when it is put together is the same, too.
      const [en, pt] = texts as [string, string];
      expect([/^\s/.test(pt), /\s$/.test(pt)], key).toEqual([/^\s/.test(en), /\s$/.test(en)]);
    }
  });

  it("holds nothing that the page does not say", () => {
    const all = sources(["ui", "state", "map", "api", "."])
      .map(({ text }) => text)
      .join("\n");
    const said = (key: Key) => key in NAMES || all.includes(`"${key}"`);
    expect(keys.filter((key) => !said(key))).toEqual([]);
  });
});

describe("a text", () => {
  it("is filled in, with the word that suits a number", () => {
    expect(say("readout.sounding", { count: 1 })).toBe("1 sounding");
    expect(say("readout.sounding", { count: 3 })).toBe("3 soundings");
    chosenLanguage.value = "pt";
    expect(say("readout.sounding", { count: 1 })).toBe("1 sonda");
    expect(say("readout.sounding", { count: 3 })).toBe("3 sondas");
  });

  it("takes pieces of the page in its places", () => {
    expect(sayWith("time.step", { b: 7, it: " of 9" }).join("")).toBe("Step 7 of 9");
  });
});

describe("the language", () => {
  it.each([
    [["pt-PT", "en"], "pt"],
    [["PT-br"], "pt"],
    [["de", "en-GB"], "en"],
    [["fi"], "en"],
    [[], "en"],
  ] as const)("of a browser that asks for %j is %s", (wanted, language) => {
    expect(languageOf(wanted)).toBe(language);
  });
});

/** Attributes whose text people read or hear. */
const TOLD =
  /^(title|label|alt|placeholder|heading|what|hint|question|done|closing|words|why|aria-(label|valuetext|description))$/;
/** Attributes of which they see nothing. */
const UNTOLD =
  /^(class|kind|id|data-.*|style|key|href|style|transform|points?|d|src|form|type|role|.*Id|viewBox|aria-.*)$/;
/** Names and signs that are the same in every language. */
const SAME =
  /^(km²?|kn|nmi|min|MB|(Multi)?Polygon|Feature|.*sans-serif|[\da-f]{6}( [\da-f]{6})*|(\d+ )?\d+px|bathyfleet.*|IMC|UTC|S-44|0x|MMSI|[NESW]{1,2}|J|GeoTIFF|Hz|[a-z]+:\/\/.*)$/;

/** Keys, types and fonts that look like words. */
const NO_WORDS = new Set([
  "ui/parts/Controls.tsx: Enter",
  "ui/parts/Controls.tsx: Escape",
  "ui/parts/Dialog.tsx: Escape",
  "ui/keys.ts: Shift A",
  "ui/keys.ts: Tab",
  "ui/keys.ts: Escape",
  "ui/form/Fields.tsx: a field outside its form",
  "ui/chart/GoTo.tsx: Escape",
  "ui/chart/MapMenu.tsx: Escape",
  "ui/chart/mapUpdates.tsx: waypoint",
  "ui/chart/mapUpdates.tsx: vehicle",
  "ui/chart/mapUpdates.tsx: turn-back",
  "state/alarms/attention.ts: alarm",
  "state/alarms/attention.ts: mission",
  "state/alarms/attention.ts: vehicle",
  "state/alarms/attention.ts: warning",
  "state/form/draft.ts: the draft has faults",
  "map/canvas/chart.ts: mark",
  "map/canvas/chart.ts: ship",
  "map/canvas/chart.ts: target",
  "map/canvas/canvasLayers.ts: sheet",
  "map/canvas/canvasLayers.ts: px) scale(",
  "map/marks/site.ts: cells came for",
]);

/** What of a component is text of its own instead of the catalogue's. */
function literalsIn(name: string, text: string): string[] {
  const found: string[] = [];
  const file = ts.createSourceFile(name, text, ts.ScriptTarget.Latest, true, ts.ScriptKind.TSX);
  const note = (words: string) => {
    const plain = words.trim().replaceAll(/\s+/g, " ");
    if (/\p{L}{2}/u.test(plain) && !SAME.test(plain)) found.push(`${name}: ${plain}`);
  };
  const visit = (node: ts.Node): void => {
    if (ts.isImportDeclaration(node) || ts.isTypeNode(node) || ts.isInterfaceDeclaration(node)) return;
    if (ts.isJsxAttribute(node)) {
      const attribute = node.name.getText();
      if (TOLD.test(attribute) && node.initializer && ts.isStringLiteral(node.initializer)) {
        note(node.initializer.text);
        return;
      }
      if (UNTOLD.test(attribute) && !TOLD.test(attribute)) return;
    }
    if (ts.isCallExpression(node) && /^(say|sayWith)$/.test(node.expression.getText())) {
      for (const filled of node.arguments.slice(1)) ts.forEachChild(filled, visit);
      return;
    }
    if (ts.isJsxElement(node) && node.openingElement.tagName.getText() === "code") return;
    if (ts.isJsxText(node)) note(node.text);
    // A sentence: words with a space between them, or one that begins as a heading does.
    else if (ts.isStringLiteralLike(node) && /^\p{Lu}\p{Ll}+$|\p{L}\s\p{L}/u.test(node.text)) note(node.text);
    else if (ts.isTemplateExpression(node)) {
      const parts = [node.head.text, ...node.templateSpans.map(({ literal }) => literal.text)];
      for (const part of parts) if (/\p{L}{2,}\s|\s\p{L}{2,}/u.test(part)) note(part);
    }
    ts.forEachChild(node, visit);
  };
  visit(file);
  return found;
}

describe("a component", () => {
  it("has no text of its own, which one language only could read", () => {
    const own = sources(["ui", "state", "map"]).flatMap(({ name, text }) => literalsIn(name, text));
    // The words of a file format are no texts.
    const told = own.filter(
      (one) => !NO_WORDS.has(one) && !/^(map\/print\/pdf|state\/form\/planFile)\.ts/.test(one),
    );
    expect(told).toEqual([]);
  });

  it("is caught with one", () => {
    const told = ["`$", "{n} minutes left`"].join("");
    const caught = literalsIn("x.tsx", `const a = <p title="Hold it">Go home{${told}}</p>;`);
    expect(caught).toEqual(["x.tsx: Hold it", "x.tsx: Go home", "x.tsx: minutes left"]);
  });
});
