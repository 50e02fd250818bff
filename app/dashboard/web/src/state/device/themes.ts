/** What the page looks like: by day, in the dark, in the sun, and on a bridge at night. */

import { type Key, say } from "../../words/say";
import type { Theme } from "../store";

export const THEMES: readonly Theme[] = ["system", "light", "dark", "contrast", "night"];

const KEYS = {
  system: "topBar.system",
  light: "topBar.light",
  dark: "topBar.dark",
  contrast: "topBar.contrast",
  night: "topBar.night",
} as const satisfies Record<Theme, Key>;

export const themeWords = (theme: Theme): string => say(KEYS[theme]);

/** The next one, for a key or a button that walks through all. */
export const themeAfter = (theme: Theme): Theme =>
  THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length] ?? "system";
