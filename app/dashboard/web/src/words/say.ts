/** The page's words: what stands in the catalogue, in the language that was chosen, with what is filled in. */

import { computed, effect } from "@preact/signals";
import { type ComponentChild, cloneElement, isValidElement } from "preact";
import { kept } from "../persistentSignal";
import { CATALOGUE } from "./catalogue";

export const LANGUAGES = ["en", "pt"] as const;
export type Language = (typeof LANGUAGES)[number];
/** How each language calls itself. */
export const OWN_NAMES: Readonly<Record<Language, string>> = { en: "English", pt: "Português" };

export type Key = keyof typeof CATALOGUE;

/** What a text leaves open: `{name}`, or `{name|one|many}` for a word that follows a number. */
type Open<Text extends string> = Text extends `${string}{${infer Inside}}${infer Rest}`
  ? NameOf<Inside> | Open<Rest>
  : never;
type NameOf<Inside extends string> = Inside extends `${infer Name}|${string}` ? Name : Inside;
type OpenOf<K extends Key> = Open<(typeof CATALOGUE)[K]["en"]>;

/** Nothing where the text leaves nothing open. */
type Filled<K extends Key, Value> = [OpenOf<K>] extends [never] ? [] : [Readonly<Record<OpenOf<K>, Value>>];

/** The language chosen on this device; "system": the browser's. */
export const chosenLanguage = kept<Language | "system">("language", "system");

/** The first of the browser's languages that the page speaks, else English. */
export function languageOf(wanted: readonly string[]): Language {
  const spoken = wanted.map((tag) => tag.toLowerCase().split("-")[0]);
  return spoken.flatMap((tag) => LANGUAGES.filter((one) => one === tag))[0] ?? "en";
}

const isLanguage = (value: string): value is Language => LANGUAGES.includes(value as Language);

export const language = computed<Language>(() => {
  const chosen = chosenLanguage.value;
  return isLanguage(chosen) ? chosen : languageOf(globalThis.navigator?.languages ?? []);
});

/** As numbers and dates are written in it. */
export const locale = computed(() => (language.value === "pt" ? "pt-PT" : "en-GB"));

const PART = /\{(\w+)(?:\|([^|}]*)\|([^|}]*))?\}/g;

/** A text with its open places filled; a number in a text is written as it comes. */
export function say<K extends Key>(key: K, ...[filled]: Filled<K, string | number>): string {
  const values = (filled ?? {}) as Readonly<Record<string, string | number>>;
  return CATALOGUE[key][language.value].replaceAll(PART, (_, name: string, one?: string, many?: string) =>
    one === undefined ? String(values[name]) : Number(values[name]) === 1 ? one : (many ?? one),
  );
}

/** What the service calls `name`, in the page's words where it has some, else `otherwise`. */
export function named(
  group: "failsafe" | "layer" | "choice" | "sensor",
  name: string,
  otherwise: string,
): string {
  const key = `${group}.${name}`;
  return key in CATALOGUE ? CATALOGUE[key as Key][language.value] : otherwise;
}

/** The same with pieces of the page in its open places. */
export function sayWith<K extends Key>(key: K, ...[filled]: Filled<K, ComponentChild>): ComponentChild[] {
  const values = (filled ?? {}) as Readonly<Record<string, ComponentChild>>;
  const pieces = CATALOGUE[key][language.value].split(/(\{\w+\})/);
  return pieces.map((piece, i) => {
    const name = /^\{(\w+)\}$/.exec(piece)?.[1];
    if (name === undefined) return piece;
    const value = values[name];
    return isValidElement(value) ? cloneElement(value, { key: i }) : value;
  });
}

if (typeof document !== "undefined") {
  effect(() => {
    document.documentElement.lang = language.value;
  });
}
