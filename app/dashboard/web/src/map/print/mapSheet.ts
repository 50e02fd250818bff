/** The map as one sheet of paper: what is on the screen, in a frame with title, legend, scale, north and degrees. */

import type { LngLat } from "../../api/types";
import type { Paper } from "../canvas/mapColours";
import { Projection } from "../canvas/projection";
import { graticule, graticuleStep } from "../geo";

const EARTH_ROUND_M = 40_075_016.686;
const NAUTICAL_MILE_M = 1852;
const FONT = "system-ui, sans-serif";

/** A4 in pixels of style sheets. */
const LONG_PX = 1123;
const SHORT_PX = 794;
const MARGIN = { left: 74, right: 34, top: 76, bottom: 104 };
const SCALE_PX = 180;

export interface SheetVehicle {
  name: string;
  at: LngLat;
  heading_deg: number | null;
  colour: string;
}

/** What the legend says: a scale of colours, or classes with a colour each. */
export type SheetLegend =
  | { title: string; stops: readonly string[]; low: string; high: string }
  | { title: string; classes: readonly { words: string; colour: string }[] };

export interface SheetWords {
  title: string;
  /** Under the title: when, what state. */
  subtitle: string;
  /** At the foot: datum, frame, what is hatched. */
  notes: readonly string[];
  latitude: (degrees: number, decimals: number) => string;
  longitude: (degrees: number, decimals: number) => string;
  /** A round length in words. */
  length: (metres: number) => string;
  north: string;
}

export interface SheetContent {
  words: SheetWords;
  legend: SheetLegend | null;
  vehicles: readonly SheetVehicle[];
  paper: Paper;
  nautical: boolean;
  /** What lies on the map itself. */
  paint: (context: CanvasRenderingContext2D, at: Projection) => void;
}

export interface SheetFrame {
  width: number;
  height: number;
  frame: { left: number; top: number; width: number; height: number };
}

/** The sheet for something that is seen in a window of this shape: on its side where that is wide. */
export function sheetFor(width: number, height: number): SheetFrame {
  const [w, h] = width >= height ? [LONG_PX, SHORT_PX] : [SHORT_PX, LONG_PX];
  return {
    width: w,
    height: h,
    frame: {
      left: MARGIN.left,
      top: MARGIN.top,
      width: w - MARGIN.left - MARGIN.right,
      height: h - MARGIN.top - MARGIN.bottom,
    },
  };
}

/** The camera that shows a window's part (pixels, from its upper left) as large as the frame allows. */
export function fitted(
  seen: Projection,
  part: { left: number; top: number; width: number; height: number },
  frame: { width: number; height: number },
): Projection {
  const centre = seen.place(part.left + part.width / 2, part.top + part.height / 2);
  const grow = Math.min(frame.width / part.width, frame.height / part.height);
  return new Projection(
    { centre, zoom: seen.camera.zoom + Math.log2(Math.max(grow, 1e-3)) },
    frame.width,
    frame.height,
  );
}

/** How many metres a pixel in the middle of the map stands for. */
export function metresPerPixel({ camera: { centre, zoom } }: Projection): number {
  return (EARTH_ROUND_M * Math.cos((centre[1] * Math.PI) / 180)) / (512 * 2 ** zoom);
}

/** The largest round length, metres, that is no longer than `most_m`; in nautical miles where these are wanted and fit. */
export function roundLength(most_m: number, nautical: boolean): number {
  const unit = nautical && most_m >= 0.1 * NAUTICAL_MILE_M ? NAUTICAL_MILE_M : 1;
  const most = most_m / unit;
  const power = 10 ** Math.floor(Math.log10(most));
  const step = [5, 2, 1].find((one) => one * power <= most * (1 + 1e-9)) ?? 1;
  return step * power * unit;
}

/** Draws the whole sheet, in pixels of style sheets. */
export function drawSheet(
  context: CanvasRenderingContext2D,
  { width, height, frame }: SheetFrame,
  at: Projection,
  content: SheetContent,
): void {
  context.fillStyle = "#ffffff";
  context.fillRect(0, 0, width, height);
  context.save();
  context.translate(frame.left, frame.top);
  context.beginPath();
  context.rect(0, 0, frame.width, frame.height);
  context.clip();
  context.fillStyle = content.paper.sea;
  context.fillRect(0, 0, frame.width, frame.height);
  content.paint(context, at);
  for (const vehicle of content.vehicles) drawVehicle(context, at, vehicle);
  drawNorth(context, frame.width - 34, 46, content.words.north);
  drawScale(context, 18, frame.height - 20, at, content);
  context.restore();
  context.strokeStyle = "#000000";
  context.lineWidth = 1.2;
  context.strokeRect(frame.left, frame.top, frame.width, frame.height);
  drawDegrees(context, frame, at, content.words);
  drawWords(context, width, height, frame, content);
}

function drawVehicle(
  context: CanvasRenderingContext2D,
  at: Projection,
  { name, at: [lng, lat], heading_deg, colour }: SheetVehicle,
): void {
  const [x, y] = [at.x(lng), at.y(lat)];
  context.save();
  context.translate(x, y);
  context.rotate(((heading_deg ?? 0) * Math.PI) / 180);
  context.beginPath();
  if (heading_deg === null) context.arc(0, 0, 7, 0, 2 * Math.PI);
  else {
    context.moveTo(0, -13);
    context.lineTo(8.5, 10);
    context.lineTo(0, 5.5);
    context.lineTo(-8.5, 10);
    context.closePath();
  }
  context.fillStyle = colour;
  context.fill();
  context.strokeStyle = "#10181d";
  context.lineWidth = 1.4;
  context.stroke();
  context.restore();
  label(context, name, x + 16, y + 4, "start");
}

function label(
  context: CanvasRenderingContext2D,
  words: string,
  x: number,
  y: number,
  align: CanvasTextAlign,
): void {
  context.font = `600 12px ${FONT}`;
  context.textAlign = align;
  context.textBaseline = "alphabetic";
  context.lineWidth = 3;
  context.strokeStyle = "rgba(255,255,255,0.9)";
  context.strokeText(words, x, y);
  context.fillStyle = "#0b1b24";
  context.fillText(words, x, y);
}

function drawNorth(context: CanvasRenderingContext2D, x: number, y: number, words: string): void {
  context.beginPath();
  context.moveTo(x, y - 22);
  context.lineTo(x + 8, y + 12);
  context.lineTo(x, y + 6);
  context.lineTo(x - 8, y + 12);
  context.closePath();
  context.fillStyle = "#0b1b24";
  context.fill();
  context.lineWidth = 1.5;
  context.strokeStyle = "#ffffff";
  context.stroke();
  label(context, words, x, y + 28, "center");
}

function drawScale(
  context: CanvasRenderingContext2D,
  x: number,
  y: number,
  at: Projection,
  { nautical, words }: SheetContent,
): void {
  const metre_px = 1 / metresPerPixel(at);
  const length_m = roundLength(SCALE_PX / metre_px, nautical);
  const length_px = length_m * metre_px;
  for (let i = 0; i < 4; i++) {
    context.fillStyle = i % 2 === 0 ? "#0b1b24" : "#ffffff";
    context.fillRect(x + (i * length_px) / 4, y - 6, length_px / 4, 6);
  }
  context.strokeStyle = "#0b1b24";
  context.lineWidth = 1;
  context.strokeRect(x, y - 6, length_px, 6);
  label(context, "0", x, y - 11, "center");
  label(context, words.length(length_m), x + length_px, y - 11, "center");
}

/** Degrees along the frame's edges, where the lines of the grid meet them. */
function drawDegrees(
  context: CanvasRenderingContext2D,
  frame: SheetFrame["frame"],
  at: Projection,
  { latitude, longitude }: SheetWords,
): void {
  const [west, north] = at.place(0, 0);
  const [east, south] = at.place(at.width, at.height);
  const bounds = [west, south, east, north] as const;
  const { meridians, parallels, decimals } = graticule([...bounds], graticuleStep([...bounds]));
  context.font = `11px ${FONT}`;
  context.fillStyle = "#0b1b24";
  context.textBaseline = "alphabetic";
  context.textAlign = "center";
  for (const lng of meridians)
    context.fillText(longitude(lng, decimals), frame.left + at.x(lng), frame.top + frame.height + 15);
  context.textBaseline = "middle";
  for (const lat of parallels) {
    context.save();
    context.translate(frame.left - 10, frame.top + at.y(lat));
    context.rotate(-Math.PI / 2);
    context.fillText(latitude(lat, decimals), 0, 0);
    context.restore();
  }
}

function drawWords(
  context: CanvasRenderingContext2D,
  width: number,
  height: number,
  frame: SheetFrame["frame"],
  { words, legend }: SheetContent,
): void {
  context.textAlign = "start";
  context.textBaseline = "alphabetic";
  context.fillStyle = "#000000";
  context.font = `700 20px ${FONT}`;
  context.fillText(words.title, frame.left, 40, width - frame.left - MARGIN.right);
  context.font = `13px ${FONT}`;
  context.fillText(words.subtitle, frame.left, 60, width - frame.left - MARGIN.right);
  const top = frame.top + frame.height + 34;
  const legendWidth = Math.min(340, frame.width * 0.45);
  if (legend) drawLegend(context, frame.left, top, legendWidth, legend);
  context.font = `12px ${FONT}`;
  context.fillStyle = "#000000";
  const x = frame.left + (legend ? legendWidth + 36 : 0);
  words.notes.forEach((note, i) => {
    context.fillText(note, x, top + 4 + i * 17, width - x - MARGIN.right);
  });
  context.font = `10px ${FONT}`;
  context.textAlign = "end";
  context.fillText("bathyfleet", width - MARGIN.right, height - 12);
}

function drawLegend(
  context: CanvasRenderingContext2D,
  x: number,
  y: number,
  width: number,
  legend: SheetLegend,
): void {
  context.font = `600 12px ${FONT}`;
  context.fillText(legend.title, x, y + 4);
  context.font = `12px ${FONT}`;
  if ("classes" in legend) {
    legend.classes.forEach(({ words, colour }, i) => {
      const [left, top] = [x + (i % 2) * (width / 2), y + 14 + Math.floor(i / 2) * 18];
      context.fillStyle = colour;
      context.fillRect(left, top, 14, 12);
      context.fillStyle = "#000000";
      context.fillText(words, left + 20, top + 10, width / 2 - 24);
    });
    return;
  }
  const colours = context.createLinearGradient(x, 0, x + width, 0);
  legend.stops.forEach((colour, i) => {
    colours.addColorStop(i / (legend.stops.length - 1), colour);
  });
  context.fillStyle = colours;
  context.fillRect(x, y + 12, width, 14);
  context.strokeStyle = "#000000";
  context.lineWidth = 0.8;
  context.strokeRect(x, y + 12, width, 14);
  context.fillStyle = "#000000";
  context.fillText(legend.low, x, y + 41);
  context.textAlign = "end";
  context.fillText(legend.high, x + width, y + 41);
  context.textAlign = "start";
}
