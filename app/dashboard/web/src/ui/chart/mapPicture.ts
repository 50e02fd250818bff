/** The map as a file that looks like the screen. */

import { signal } from "@preact/signals";
import type { Chart } from "../../map/canvas/chart";
import { type Look, PAPER } from "../../map/canvas/mapColours";
import { drawingOf, drawnBy } from "../../map/picture/drawings";
import { paletteOf, symbolOf } from "../../map/picture/layerColours";
import { colourAt, type Rgb } from "../../map/picture/palette";
import { drawSheet, fitted, type SheetLegend, type SheetVehicle, sheetFor } from "../../map/print/mapSheet";
import { pdfOf } from "../../map/print/pdf";
import { dayAndTimeUtc, distance, latitude, longitude, plain, units } from "../../state/format";
import { replayed } from "../../state/past/replay";
import { missionWords } from "../../state/stateNames";
import {
  depthPalette,
  live,
  mission,
  replayStep,
  serviceNow,
  showHatching,
  shownCertainty,
  shownLayer,
  shownRange,
  vehicles,
  view,
} from "../../state/store";
import { named, say } from "../../words/say";
import { overlaid } from "./layout";
import { look } from "./mapUpdates";

/** The map that is on the page, once it is. */
export const shownChart = signal<Chart | null>(null);
/** Why there is none: a browser without WebGL 2; empty while all is well. */
export const chartFault = signal("");

/** Pixels of the picture for each of the page's: sharp on paper at 192 to the inch. */
const RATIO = 2;
const STOPS = 24;

export type PictureKind = "png" | "pdf";

/** A sheet of A4 with what the map shows, on paper of a look. Throws where there is no map. */
function sheetOn(paper: Look) {
  const chart = shownChart.peek();
  const present = mission.peek();
  if (!chart || !present) throw new Error(say("topBar.noMissionIsChosen"));
  const { window, part } = chart.seen(overlaid());
  const sheet = sheetFor(part.width, part.height);
  const at = fitted(window, part, sheet.frame);
  const canvas = document.createElement("canvas");
  canvas.width = Math.round(sheet.width * RATIO);
  canvas.height = Math.round(sheet.height * RATIO);
  const context = canvas.getContext("2d");
  if (!context) throw new Error(say("paper.thisBrowserCannotDrawOnA"));
  context.setTransform(RATIO, 0, 0, RATIO, 0, 0);
  const step = replayStep.peek();
  const words = live.peek()
    ? missionWords(present)
    : say("topBar.whenLastHeard", { words: missionWords(present) });
  const when = step === null ? words : say("cards.atStep", { replayStep: step });
  const { vehiclesAt, clockAhead_ms } = view.peek();
  const shownAt = live.peek() ? serviceNow.peek() : vehiclesAt + clockAhead_ms;
  drawSheet(context, sheet, at, {
    words: {
      title: present.name,
      subtitle: `${when} · ${dayAndTimeUtc(new Date(shownAt))}`,
      notes: notes(),
      latitude,
      longitude,
      length: (metres) => distance(metres),
      north: say("picture.north"),
    },
    legend: legend(),
    vehicles: marks(),
    paper: PAPER[paper],
    nautical: units.peek() === "nautical",
    paint: (on, to) => chart.paintOn(on, to, paper),
  });
  return { canvas, context, sheet, present };
}

/** The map as it is printed, on white paper; null where there is none. */
export const printedMap = (): HTMLCanvasElement | null =>
  shownChart.peek() && mission.peek() ? sheetOn("light").canvas : null;

/** Draws what the map shows as a sheet of A4. Throws where there is no map. */
export async function mapPicture(kind: PictureKind): Promise<{ name: string; content: Blob }> {
  const { canvas, context, sheet, present } = sheetOn(look());
  const name = `${present.name.replaceAll(/[^\p{L}\p{N}._-]+/gu, "-") || "map"}-${shownLayer.peek()?.name ?? "map"}.${kind}`;
  if (kind === "pdf") {
    const picture = context.getImageData(0, 0, canvas.width, canvas.height);
    return { name, content: await pdfOf(picture, sheet, present.name) };
  }
  const content = await new Promise<Blob | null>((resolve) => canvas.toBlob(resolve, "image/png"));
  if (!content) throw new Error(say("paper.thisBrowserCannotDrawOnA"));
  return { name, content };
}

function notes(): string[] {
  const { none_m } = shownCertainty.peek() ?? {};
  return [
    say("picture.frame"),
    ...(showHatching.peek() ? [say("picture.hatched")] : []),
    ...(none_m === undefined ? [] : [say("picture.nothing", { none: plain(Number(none_m.toPrecision(2))) })]),
  ];
}

const css = (colour: Rgb): string => `rgb(${colour.map(Math.round).join(" ")})`;

function legend(): SheetLegend | null {
  const shown = shownLayer.peek();
  const range = shownRange.peek();
  if (!shown || !range) return null;
  const unit = symbolOf(shown);
  const title = named("layer", shown.name, shown.title) + (unit ? `, ${unit}` : "");
  const drawn = drawnBy(shown);
  if (drawn) {
    const { words, colours } = drawingOf(drawn);
    return { title, classes: words().map((one, i) => ({ words: one, colour: css(colours[i] as Rgb) })) };
  }
  const palette = paletteOf(shown, depthPalette.peek());
  const colour = (value: number) => css(colourAt(palette, value, range.low, range.high));
  if (shown.classes.length > 0)
    return { title, classes: shown.classes.map((words, i) => ({ words, colour: colour(i) })) };
  const span = range.high - range.low;
  const stops = [...Array(STOPS + 1).keys()].map((i) => colour(range.low + (i / STOPS) * span));
  return { title, stops, low: plain(range.low), high: plain(range.high) };
}

/** Vehicles where the map shows them: now, or at the step that is replayed. */
function marks(): SheetVehicle[] {
  const past = replayed.peek();
  if (past) {
    return past.map(({ vehicle, place, colour }) => ({
      name: vehicle,
      at: place,
      heading_deg: null,
      colour,
    }));
  }
  return vehicles
    .peek()
    .flatMap(({ view: { name, lon_deg, lat_deg, heading_deg }, colour }) =>
      lon_deg === null || lat_deg === null ? [] : [{ name, at: [lon_deg, lat_deg], heading_deg, colour }],
    );
}
