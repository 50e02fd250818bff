/** What lies still on the map: the sea floor with its contours, the grid, area and zones, where vehicles have been. */

import type { LngLat, PolygonGeometry } from "../../api/types";
import { graticule, graticuleStep } from "../geo";
import type { NamedLine } from "../marks/lines";
import type { Track } from "../marks/marks";
import type { Contour } from "../picture/contours";
import { type Land, paintCoasts, showsCoast } from "./coast";
import { type Paper, striped } from "./mapColours";
import { paintPlannedLines } from "./plannedLines";
import { labelPlaces, type Pixel, simplified } from "./polylines";
import type { Projection } from "./projection";
import { line, stroke, trace, way } from "./shapes";

const INK = "#0b1b24";
const HALO = "rgba(255,255,255,0.85)";
const LABEL_PX = 12;
const LABEL_SPACING_PX = 260;
/** Free room around a label. */
const LABEL_PADDING_PX = 8;
/** Between the stripes of what is guessed, and how strong they are. */
const STRIPES_PX = 9;
const HATCHED = 0.3;
/** Every so many contours one is drawn stronger and labelled. */
const MAIN_EVERY = 2;

export interface FloorPicture {
  corners: readonly LngLat[];
  rows: number;
  cols: number;
  image: HTMLCanvasElement;
  /** Opaque where depths are guessed; null where nothing is. */
  guessed: HTMLCanvasElement | null;
  /** Whether cells flow into each other. */
  smooth: boolean;
  contours: readonly Contour[];
  /** Contours' levels are whole numbers: so many make a metre. */
  scale: number;
  interval: number;
}

export interface StillContent {
  /** Coasts of the world, where they are wanted and here. */
  lands: readonly Land[];
  floor: FloorPicture | null;
  /** Whether what is guessed is hatched. */
  hatched: boolean;
  area: PolygonGeometry | null;
  keepOut: readonly PolygonGeometry[];
  /** Of a line plan. */
  lines: readonly NamedLine[];
  tracks: readonly Track[];
  /** Outlines of what swath sonars missed. */
  holidays: readonly (readonly (readonly LngLat[])[])[];
  /** Where lines cross and disagree. */
  crossings: readonly LngLat[];
  /** What a search knows of its site. */
  site: { corners: readonly LngLat[]; image: HTMLCanvasElement } | null;
}

/** A picture as something that can be drawn again and again. */
export function imageOf(
  picture: { pixels: Uint8ClampedArray<ArrayBuffer>; width: number; height: number },
  before: HTMLCanvasElement | undefined,
): HTMLCanvasElement {
  const canvas = before ?? document.createElement("canvas");
  if (canvas.width !== picture.width || canvas.height !== picture.height) {
    canvas.width = picture.width;
    canvas.height = picture.height;
  }
  canvas.getContext("2d")?.putImageData(new ImageData(picture.pixels, picture.width, picture.height), 0, 0);
  return canvas;
}

export function paintStill(
  context: CanvasRenderingContext2D,
  at: Projection,
  window: Projection,
  { lands, floor, hatched, area, keepOut, lines, tracks, holidays, crossings, site }: StillContent,
  paper: Paper,
): void {
  context.lineCap = context.lineJoin = "round";
  if (showsCoast(window.camera.zoom)) paintCoasts(context, at, lands, paper);
  if (floor) {
    context.save();
    clip(context, at, area);
    paintFloor(context, at, hatched ? floor : { ...floor, guessed: null }, paper);
    context.restore();
  }
  if (site) paintGridded(context, at, site.corners, site.image);
  paintGrid(context, at, window, paper);
  for (const zone of keepOut) paintStriped(context, at, zone.coordinates as LngLat[][], paper.keepOut);
  for (const rings of holidays) paintStriped(context, at, rings, paper.holiday, paper.casing);
  for (const ring of area?.coordinates ?? []) {
    line(context, at, ring as LngLat[], { colour: paper.area, width: 2 }, true);
  }
  paintPlannedLines(context, at, lines, paper);
  for (const track of tracks) way(context, at, track, paper.casing);
  for (const place of crossings) paintCrossing(context, at, place, paper);
}

/** Nothing is known beyond the area: cells that it cuts are drawn as far as it reaches. */
function clip(context: CanvasRenderingContext2D, at: Projection, area: PolygonGeometry | null): void {
  if (!area) return;
  context.beginPath();
  for (const ring of area.coordinates) trace(context, at, ring as LngLat[], true);
  context.clip("evenodd");
}

/** Half the width of the sign of a crossing, pixels. */
const ARM = 6;

function paintCrossing(
  context: CanvasRenderingContext2D,
  at: Projection,
  [lng, lat]: LngLat,
  paper: Paper,
): void {
  const [x, y] = [at.x(lng), at.y(lat)];
  context.beginPath();
  for (const side of [-ARM, ARM]) {
    context.moveTo(x - ARM, y - side);
    context.lineTo(x + ARM, y + side);
  }
  stroke(context, { colour: paper.casing, width: 6 });
  stroke(context, { colour: paper.crossing, width: 3 });
}

/** Draws a picture over the grid with these corners; returns where three of them are on the sheet. */
function paintGridded(
  context: CanvasRenderingContext2D,
  at: Projection,
  corners: readonly LngLat[],
  image: HTMLCanvasElement,
  smooth = false,
): { northWest: Pixel; east: Pixel; south: Pixel } | null {
  const [northWest, northEast, , southWest] = corners.map(([lng, lat]): Pixel => [at.x(lng), at.y(lat)]);
  if (!northWest || !northEast || !southWest) return null;
  // The grid is a parallelogram: its picture's pixels, and its columns and rows, become those of the sheet.
  const east: Pixel = [northEast[0] - northWest[0], northEast[1] - northWest[1]];
  const south: Pixel = [southWest[0] - northWest[0], southWest[1] - northWest[1]];
  context.save();
  context.transform(
    east[0] / image.width,
    east[1] / image.width,
    south[0] / image.height,
    south[1] / image.height,
    northWest[0],
    northWest[1],
  );
  context.imageSmoothingEnabled = smooth || Math.hypot(...east) < image.width;
  context.imageSmoothingQuality = "high";
  context.drawImage(image, 0, 0);
  context.restore();
  return { northWest, east, south };
}

function paintFloor(
  context: CanvasRenderingContext2D,
  at: Projection,
  floor: FloorPicture,
  paper: Paper,
): void {
  const { rows, cols } = floor;
  const placed = paintGridded(context, at, floor.corners, floor.image, floor.smooth);
  if (!placed) return;
  if (floor.guessed) paintGuessed(context, at, floor, floor.guessed, paper);
  const { northWest, east, south } = placed;
  const pixel = ([col, row]: [number, number]): Pixel => {
    const [u, v] = [col / cols, 1 - row / rows];
    return [northWest[0] + u * east[0] + v * south[0], northWest[1] + u * east[1] + v * south[1]];
  };
  paintContours(context, at, floor, pixel);
}

/** Where what is guessed is hatched first, then laid on the sheet. */
let hatchSheet: CanvasRenderingContext2D | null = null;

/** Hatches what is guessed: stripes of the sheet, whatever the size of cells, that stay where they are on the ground. */
function paintGuessed(
  context: CanvasRenderingContext2D,
  at: Projection,
  { corners, smooth }: FloorPicture,
  guessed: HTMLCanvasElement,
  paper: Paper,
): void {
  hatchSheet ??= document.createElement("canvas").getContext("2d");
  const corner = corners[0];
  if (!hatchSheet || !corner) return;
  const { canvas } = hatchSheet;
  canvas.width = context.canvas.width;
  canvas.height = context.canvas.height;
  hatchSheet.setTransform(context.getTransform());
  const pattern = hatchSheet.createPattern(striped(paper.ink, STRIPES_PX, 1), "repeat");
  if (!pattern) return;
  const phase = (pixels: number) => Math.round(pixels) % STRIPES_PX;
  pattern.setTransform(new DOMMatrix([1, 0, 0, 1, phase(at.x(corner[0])), phase(at.y(corner[1]))]));
  hatchSheet.fillStyle = pattern;
  hatchSheet.fillRect(0, 0, at.width, at.height);
  hatchSheet.globalCompositeOperation = "destination-in";
  paintGridded(hatchSheet, at, corners, guessed, smooth);
  context.save();
  context.resetTransform();
  context.globalAlpha = HATCHED;
  context.drawImage(canvas, 0, 0);
  context.restore();
}

function paintContours(
  context: CanvasRenderingContext2D,
  at: Projection,
  { contours, interval, scale }: FloorPicture,
  pixel: (place: [number, number]) => Pixel,
): void {
  const lines = contours.map(({ level, points }) => ({
    level,
    main: Math.round(level / interval) % MAIN_EVERY === 0,
    points: simplified(points.length, (i) => pixel(points[i] as [number, number])),
  }));
  for (const main of [false, true]) {
    context.beginPath();
    for (const one of lines) {
      if (one.main !== main) continue;
      one.points.forEach(([x, y], i) => {
        if (i === 0) context.moveTo(x, y);
        else context.lineTo(x, y);
      });
    }
    stroke(context, { colour: INK, width: main ? 1.4 : 0.7, opacity: 0.75 });
  }
  context.font = `${LABEL_PX}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  const digits = Math.max(0, -Math.floor(Math.log10(interval / scale) + 1e-9));
  const taken: { x: number; y: number; radius: number }[] = [];
  for (const { level, main, points } of lines) {
    if (!main) continue;
    const label = (level / scale).toFixed(digits);
    const width = context.measureText(label).width;
    const radius = width / 2 + LABEL_PADDING_PX;
    for (const { x, y, angle } of labelPlaces(points, width, LABEL_SPACING_PX)) {
      if (x < 0 || y < 0 || x > at.width || y > at.height) continue;
      if (taken.some((other) => Math.hypot(other.x - x, other.y - y) < other.radius + radius)) continue;
      taken.push({ x, y, radius });
      context.save();
      context.translate(x, y);
      context.rotate(angle);
      context.lineWidth = 3.2;
      context.setLineDash([]);
      context.strokeStyle = HALO;
      context.strokeText(label, 0, 0);
      context.fillStyle = INK;
      context.fillText(label, 0, 0);
      context.restore();
    }
  }
}

/** An area with its holes, striped; on a casing and in the other direction where it lies on a map's own stripes. */
function paintStriped(
  context: CanvasRenderingContext2D,
  at: Projection,
  rings: readonly (readonly LngLat[])[],
  colour: string,
  casing?: string,
): void {
  const pattern = context.createPattern(striped(colour), "repeat");
  if (casing) pattern?.setTransform(new DOMMatrix([-1, 0, 0, 1, 0, 0]));
  context.beginPath();
  for (const ring of rings) trace(context, at, ring, true);
  if (pattern) context.fillStyle = pattern;
  context.fill("evenodd");
  if (casing) stroke(context, { colour: casing, width: 5.5 });
  stroke(context, { colour, width: casing ? 3 : 2 });
}

/** The lines lie where the window's labels say, and reach over the whole sheet. */
function paintGrid(
  context: CanvasRenderingContext2D,
  at: Projection,
  window: Projection,
  paper: Paper,
): void {
  const bounds = (of: Projection) => {
    const [west, north] = of.place(0, 0);
    const [east, south] = of.place(of.width, of.height);
    return [west, south, east, north] as [number, number, number, number];
  };
  const { meridians, parallels } = graticule(bounds(at), graticuleStep(bounds(window)));
  context.beginPath();
  for (const lng of meridians) {
    context.moveTo(at.x(lng), 0);
    context.lineTo(at.x(lng), at.height);
  }
  for (const lat of parallels) {
    context.moveTo(0, at.y(lat));
    context.lineTo(at.width, at.y(lat));
  }
  stroke(context, { colour: paper.grid, width: 1, opacity: 0.7 });
}
