/** How much room the map has: what lies over it, and how wide the operator made the panels. */

import { computed, effect, signal } from "@preact/signals";
import type { Padding } from "../../map/canvas/chart";
import type { Box } from "../../map/canvas/labels";
import { isSame } from "../../map/isSame";
import { kept } from "../../persistentSignal";
import { describing, drawing, mission, now, panelOpen, picking, stripHeight, tab } from "../../state/store";

/** What lies over the map, in its pixels. */
export const covers = signal<readonly Box[]>([]);
/** How far the legend reaches from the map's upper or, on narrow windows, its lower edge. */
export const legendReach = signal({ top: 0, bottom: 0 });

/** Sizes that the operator gave to panels, pixels; null: as the style sheet has it. */
export const panelWidth = kept<number | null>("panel-width", null);
export const cardsWidth = kept<number | null>("cards-width", null);
export const paneHeight = kept<number | null>("pane-height", null);
/** Whether vehicles' cards show only what one has to know. */
export const cardsFolded = kept("cards-folded", false);

/** Beside open missions there is no room for whole cards. */
const tight = matchMedia("(max-width: 1180px)");
const isTight = signal(tight.matches);
tight.addEventListener("change", (event) => {
  isTight.value = event.matches;
});
/** One column below the other: phones, and tablets that stand upright. */
const narrow = matchMedia("(max-width: 760px), (max-width: 1000px) and (orientation: portrait)");
const isNarrow = signal(narrow.matches);
narrow.addEventListener("change", (event) => {
  isNarrow.value = event.matches;
});
export const shownFolded = computed(
  () => !isNarrow.value && (cardsFolded.value || (isTight.value && panelOpen.value)),
);

/** Whether somebody draws or picks a place where what is described in lies over the whole map: the map is seen first. */
export const mapFirst = computed(
  () => isNarrow.value && describing.value && (drawing.value !== null || picking.value !== null),
);

const OVER_THE_MAP =
  ".legend, .current, .map-tools, .beside-tools > *, .over-map > *, .card, .bottom, .missions, .maplibregl-ctrl-scale, .maplibregl-ctrl-group";
/** Above which the legend lies at the map's upper edge. */
const UPPER = 0.4;

/** Between what is to be seen and what lies over the map's edges, pixels. */
const FREE_PX = 30;

/** How far panels, tools and the legend reach over the map. */
export function overlaid(): Padding {
  const box = (panel: string) => document.querySelector(panel)?.getBoundingClientRect() ?? new DOMRect();
  const width = (panel: string) => box(panel).width;
  const { top, bottom } = legendReach.peek();
  const [left, right, below] = isNarrow.peek()
    ? [0, 0, bottom]
    : [width(".missions"), width(".cards-column"), mission.peek() ? stripHeight.peek() : 0];
  // A column on the right, or a row at the bottom, beside or above which the scale lies.
  const tools = box(".map-tools");
  const inRow = tools.width > tools.height;
  return {
    top: top + FREE_PX,
    right: right + (inRow ? 0 : tools.width) + FREE_PX,
    bottom: below + (inRow ? tools.height : 0) + box(".maplibregl-ctrl-scale").height + FREE_PX,
    left: left + FREE_PX,
  };
}

/** Keeps an eye on what lies over the map; returns what ends that. */
export function watchRoom(root: HTMLElement): () => void {
  let frame = 0;
  const measure = () => {
    frame = 0;
    const map = root.querySelector(".chart")?.getBoundingClientRect();
    if (!map) return;
    const boxes = [...root.querySelectorAll(OVER_THE_MAP)].flatMap((element) => {
      const box = element.getBoundingClientRect();
      return box.width > 0 && box.height > 0
        ? [
            {
              left: Math.round(box.left - map.left),
              top: Math.round(box.top - map.top),
              right: Math.round(box.right - map.left),
              bottom: Math.round(box.bottom - map.top),
            },
          ]
        : [];
    });
    if (!isSame(boxes, covers.peek())) covers.value = boxes;
    const legend = root.querySelector(".legend")?.getBoundingClientRect();
    const upper = legend && legend.top - map.top < UPPER * map.height;
    const reach = {
      top: legend && upper ? Math.round(legend.bottom - map.top) : 0,
      bottom: legend && !upper ? Math.round(map.bottom - legend.top) : 0,
    };
    if (!isSame(reach, legendReach.peek())) legendReach.value = reach;
  };
  const soon = () => {
    if (frame === 0) frame = requestAnimationFrame(measure);
  };
  // Whatever moves is found at the next tick; what the operator opens and drags at once.
  const stop = effect(() => {
    now.value;
    tab.value;
    panelOpen.value;
    panelWidth.value;
    cardsWidth.value;
    paneHeight.value;
    shownFolded.value;
    soon();
  });
  const watcher = new ResizeObserver(soon);
  watcher.observe(root);
  const legend = root.querySelector(".stage");
  const changes = new MutationObserver(soon);
  if (legend) changes.observe(legend, { childList: true });
  return () => {
    cancelAnimationFrame(frame);
    stop();
    watcher.disconnect();
    changes.disconnect();
  };
}
