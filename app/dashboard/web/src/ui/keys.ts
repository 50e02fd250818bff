/** What single keys do, for people who work without a mouse; the help sheet is made of the same table. */

import { signal } from "@preact/signals";
import { whyNotCommand } from "../state/access";
import { themeAfter } from "../state/device/themes";
import { act, askAbort, busyWith } from "../state/session";
import { isAllowed } from "../state/stateNames";
import {
  describing,
  dialogOpen,
  fleetOpen,
  goingTo,
  in3d,
  keysOpen,
  linksOpen,
  mission,
  openAlarms,
  panelOpen,
  preflightOpen,
  settingsOpen,
  singleKeys,
  type Tab,
  tab,
  theme,
} from "../state/store";
import type { Key } from "../words/say";
import { takeAlarms } from "./notices/acknowledge";

/** Grows when the whole area is asked for: the map follows. */
export const fitAsked = signal(0);

interface Shortcut {
  /** As the keyboard names it. */
  key: string;
  /** As it is written, where that is another way. */
  sign?: string;
  words: Key;
  run: () => void;
}

const opens = (name: Tab) => () => {
  if (mission.value) tab.value = tab.value === name ? null : name;
};
const flip = (it: { value: boolean }) => () => {
  it.value = !it.value;
};
const may = () => whyNotCommand.value === "" && busyWith.value === null;

/** Commands ask before anything moves, as their buttons do. */
export const SHORTCUTS: readonly Shortcut[] = [
  { key: "?", words: "keys.thisSheet", run: flip(keysOpen) },
  { key: ",", words: "settings.settings", run: flip(settingsOpen) },
  { key: "A", sign: "Shift A", words: "keys.abortAll", run: () => askAbort(null) },
  {
    key: "s",
    words: "keys.start",
    run: () => {
      if (mission.value && may() && isAllowed("start", mission.value)) preflightOpen.value = true;
    },
  },
  {
    key: "p",
    words: "keys.pauseOrResume",
    run: () => {
      const present = mission.value;
      if (!present || !may()) return;
      if (isAllowed("resume", present)) void act("resume");
      else if (isAllowed("pause", present) && !present.ending) void act("pause");
    },
  },
  {
    key: "t",
    words: "keys.takeAlarms",
    run: () => {
      if (openAlarms.value.length > 0 && may()) void takeAlarms();
    },
  },
  { key: "m", words: "missions.missions", run: flip(panelOpen) },
  {
    key: "n",
    words: "mission.newMission",
    run: () => {
      if (!may()) return;
      panelOpen.value = true;
      describing.value = true;
    },
  },
  { key: "v", words: "fleet.fleet", run: flip(fleetOpen) },
  { key: "i", words: "topBar.linksToVehicles", run: flip(linksOpen) },
  { key: "l", words: "keys.log", run: opens("log") },
  { key: "c", words: "bottomStrip.charts", run: opens("charts") },
  { key: "r", words: "keys.rejectedSoundings", run: opens("soundings") },
  { key: "f", words: "bottomStrip.files", run: opens("files") },
  {
    key: "q",
    words: "profile.profile",
    run: opens("profile"),
  },
  { key: "k", words: "bottomStrip.compare", run: opens("compare") },
  {
    key: "0",
    words: "mapTools.showTheWholeArea",
    run: () => {
      fitAsked.value += 1;
    },
  },
  { key: "g", words: "mapTools.goToAPosition", run: flip(goingTo) },
  { key: "d", words: "mapTools.lookAtTheSeaFloorIn", run: flip(in3d) },
  {
    key: "x",
    words: "keys.nextColours",
    run: () => {
      theme.value = themeAfter(theme.value);
    },
  },
];

/** Keys that the browser and the map know by themselves. */
export const FURTHER: readonly (readonly [sign: string, words: Key])[] = [
  ["Tab", "keys.nextControl"],
  ["Escape", "keys.close"],
  ["+ −", "keys.zoom"],
  ["← → ↑ ↓", "keys.move"],
];

/** What takes letters as text. */
const TYPING = "input:not([type=checkbox], [type=radio], [type=range]), select, textarea, [contenteditable]";

/** The shortcut that a key stands for; undefined where it is typed, held with others, or a dialog is open. */
export function shortcutOf(event: Pick<KeyboardEvent, "key" | "ctrlKey" | "altKey" | "metaKey" | "repeat">) {
  if (event.ctrlKey || event.altKey || event.metaKey || event.repeat) return undefined;
  return SHORTCUTS.find(({ key }) => key === event.key);
}

/** Follows the keyboard; returns what ends it. */
export function watchKeys(): () => void {
  const onKey = (event: KeyboardEvent) => {
    const { target } = event;
    if (!singleKeys.value || event.defaultPrevented) return;
    if (target instanceof Element && target.matches(TYPING)) return;
    const shortcut = shortcutOf(event);
    if (!shortcut) return;
    // Under a dialog nothing is to be had but the stop.
    if (dialogOpen.value && shortcut.key !== "A") return;
    event.preventDefault();
    shortcut.run();
  };
  window.addEventListener("keydown", onKey);
  return () => window.removeEventListener("keydown", onKey);
}
