/** What moves on the map, or is being pointed at: the newest ways, routes, ranges, soundings, what is being drawn. */

import type { LngLat, PolygonGeometry } from "../../api/types";
import { circle } from "../geo";
import type { NamedLine } from "../marks/lines";
import type { Circle, PlaceMark, Route, Spot, Track } from "../marks/marks";
import type { ShipMark } from "../marks/ships";
import type { SwathLine } from "../marks/swath";
import type { TargetMark } from "../marks/targets";
import { boxOf, type Side } from "./labels";
import type { Paper } from "./mapColours";
import { paintPlannedLines } from "./plannedLines";
import type { Projection } from "./projection";
import { dot, line, stroke, trace, way } from "./shapes";

const SKETCH = "#1d5c94";

/** What is under the hand while an area is drawn or its corners are dragged. */
export interface Sketch {
  lines: readonly (readonly LngLat[])[];
  handles: readonly { at: LngLat; strong: boolean }[];
}

/** What a mission that is being described would begin with; `old`: as it was described before. */
export type PlanLines = readonly {
  old: boolean;
  colour: string;
  way: readonly LngLat[];
  beyond: readonly LngLat[];
  home: readonly LngLat[];
}[];

export interface LivelyContent {
  draft: {
    areas: readonly PolygonGeometry[];
    keepOut: readonly PolygonGeometry[];
    lines: readonly NamedLine[];
  };
  plan: PlanLines;
  ranges: readonly Circle[];
  tails: readonly Track[];
  swaths: readonly SwathLine[];
  routes: readonly Route[];
  waysHome: readonly Track[];
  targets: readonly TargetMark[];
  ships: readonly ShipMark[];
  /** What the pointer is at: of a ship there its words are shown. */
  pointed: LngLat | null;
  marks: readonly PlaceMark[];
  spots: readonly Spot[];
  measure: readonly LngLat[];
  sketch: Sketch | null;
}

/** Where the words of signs are written; null: there is no room for them. */
export interface Sides {
  marks: readonly (Side | null)[];
  targets: readonly (Side | null)[];
  ships: readonly (Side | null)[];
}

/** From a sign's middle to its words, and the height of these, pixels. */
export const SIGN_REACH_PX = 14;
export const WORDS_HEIGHT_PX = 15;
export const WORDS_FONT = "12px sans-serif";

export const NOTHING: LivelyContent = {
  draft: { areas: [], keepOut: [], lines: [] },
  plan: [],
  ranges: [],
  tails: [],
  swaths: [],
  routes: [],
  waysHome: [],
  targets: [],
  ships: [],
  pointed: null,
  marks: [],
  spots: [],
  measure: [],
  sketch: null,
};

const SPOT_COLOURS: Record<string, string> = { restored: "#ffffff", doubted: "#ffd24d" };

export function paintLively(
  context: CanvasRenderingContext2D,
  at: Projection,
  content: LivelyContent,
  sides: Sides,
  paper: Paper,
): void {
  const {
    draft,
    plan,
    ranges,
    tails,
    swaths,
    routes,
    waysHome,
    targets,
    ships,
    marks,
    spots,
    measure,
    sketch,
  } = content;
  context.lineJoin = context.lineCap = "round";
  for (const ring of draft.areas.flatMap(({ coordinates }) => coordinates)) {
    line(context, at, ring as LngLat[], { colour: paper.area, width: 2.5, dash: [5, 5] });
  }
  for (const zone of draft.keepOut) {
    for (const ring of zone.coordinates) {
      line(context, at, ring as LngLat[], { colour: paper.keepOut, width: 2.5, dash: [5, 5] });
    }
  }
  paintPlannedLines(context, at, draft.lines, paper);
  paintPlan(context, at, plan, paper);
  for (const { at: place, radius_m, colour } of ranges) {
    line(context, at, circle(place, radius_m, 72), { colour, width: 1, dash: [4, 3] });
  }
  marks.forEach((mark, i) => {
    paintMark(context, at, mark, sides.marks[i] ?? null, paper);
  });
  for (const tail of tails) way(context, at, tail, paper.casing);
  for (const { ends, colour, opacity } of swaths) {
    line(context, at, ends, { colour: paper.casing, width: 7, opacity: 0.65 * opacity });
    line(context, at, ends, { colour, width: 3.5, opacity });
  }
  for (const { points, colour } of waysHome) line(context, at, points, { colour, width: 1.5, dash: [1, 5] });
  for (const { points, colour, acknowledged, arrivalRadius_m } of routes) {
    const to = points.at(-1);
    if (to) line(context, at, circle(to, arrivalRadius_m), { colour, width: 1.5, opacity: 0.8 });
    line(context, at, points, acknowledged ? { colour, width: 2.5 } : { colour, width: 2, dash: [3, 4] });
  }
  targets.forEach((target, i) => {
    paintTarget(context, at, target, sides.targets[i] ?? null, paper);
  });
  ships.forEach((ship, i) => {
    paintShip(context, at, ship, sides.ships[i] ?? null, paper);
  });
  for (const { at: place, state, chosen } of spots) {
    const edge = { colour: "#10181d", width: chosen ? 3 : 1.5 };
    dot(context, at, place, chosen ? 9 : 5.5, SPOT_COLOURS[state] ?? "#e0452f", edge);
  }
  if (measure.length > 0) {
    context.beginPath();
    trace(context, at, measure);
    stroke(context, { colour: paper.casing, width: 5 });
    stroke(context, { colour: paper.ink, width: 2 });
    for (const place of measure) dot(context, at, place, 4, paper.casing, { colour: paper.ink, width: 2 });
  }
  if (sketch) paintSketch(context, at, sketch);
}

/** Lines that are planned; what comes after a vehicle has to turn back is hardly seen. */
function paintPlan(context: CanvasRenderingContext2D, at: Projection, plan: PlanLines, paper: Paper): void {
  for (const { old, colour, way: lines, beyond, home } of plan) {
    const opacity = old ? 0.45 : 1;
    line(context, at, lines, { colour: paper.casing, width: 4, opacity: 0.5 * opacity });
    line(context, at, lines, { colour, width: 2.2, dash: [7, 3], opacity });
    line(context, at, beyond, { colour, width: 1.2, dash: [2, 5], opacity: 0.6 * opacity });
    line(context, at, home, { colour, width: 1.5, dash: [1, 5], opacity });
    const [first, turn] = [lines[0], lines.at(-1)];
    if (first) dot(context, at, first, 5, colour, { colour: paper.casing, width: 2, opacity });
    if (beyond.length > 0 && turn)
      dot(context, at, turn, 6, paper.casing, { colour: paper.keepOut, width: 3, opacity });
  }
}

function paintTarget(
  context: CanvasRenderingContext2D,
  at: Projection,
  { name, accurate, at: place, ring }: TargetMark,
  side: Side | null,
  paper: Paper,
): void {
  line(context, at, ring, { colour: paper.ink, width: accurate ? 2 : 1.5, dash: [6, 4] });
  dot(context, at, place, 6, accurate ? paper.ink : paper.casing, { colour: paper.ink, width: 2 });
  label(context, at, place, name, side, paper);
}

function paintShip(
  context: CanvasRenderingContext2D,
  at: Projection,
  { at: place, ahead, bow_deg, alarm, words }: ShipMark,
  side: Side | null,
  paper: Paper,
): void {
  const colour = alarm ? paper.keepOut : paper.ink;
  line(context, at, [place, ahead], { colour, width: alarm ? 2.5 : 1.5 });
  const [x, y] = [at.x(place[0]), at.y(place[1])];
  if (bow_deg === null) {
    dot(context, at, place, 5, paper.casing, { colour, width: 2 });
  } else {
    const turn = (bow_deg * Math.PI) / 180;
    const [sin, cos] = [Math.sin(turn), Math.cos(turn)];
    context.beginPath();
    SHIP.forEach(([across, along], i) => {
      const [px, py] = [x + across * cos + along * sin, y + across * sin - along * cos];
      if (i === 0) context.moveTo(px, py);
      else context.lineTo(px, py);
    });
    context.closePath();
    context.fillStyle = alarm ? paper.keepOut : paper.casing;
    context.fill();
    stroke(context, { colour, width: 2 });
  }
  label(context, at, place, words, side, paper);
}

/** A ship's outline: to starboard and ahead, pixels. */
const SHIP = [
  [0, 11],
  [6, -8],
  [-6, -8],
] as const;

function label(
  context: CanvasRenderingContext2D,
  at: Projection,
  place: LngLat,
  words: string,
  side: Side | null,
  paper: Paper,
): void {
  if (!side || !words) return;
  context.font = WORDS_FONT;
  const width = context.measureText(words).width;
  const box = boxOf(
    { at: [at.x(place[0]), at.y(place[1])], width, height: WORDS_HEIGHT_PX, reach: SIGN_REACH_PX },
    side,
  );
  const [x, y] = [box.left, (box.top + box.bottom) / 2];
  context.textAlign = "start";
  context.textBaseline = "middle";
  context.lineWidth = 3.2;
  context.setLineDash([]);
  context.strokeStyle = paper.casing;
  context.strokeText(words, x, y);
  context.fillStyle = paper.ink;
  context.fillText(words, x, y);
}

/** Outlines of signs about their place, pixels: a star, a door, a mast, a house, a pin's head, and a boat from above. */
const SIGNS: Record<PlaceMark["sign"], readonly (readonly [number, number])[]> = {
  goal: [...Array(10).keys()].map((i) => {
    const away = i % 2 === 0 ? 9 : 4;
    return [away * Math.sin((i * Math.PI) / 5), -away * Math.cos((i * Math.PI) / 5)] as const;
  }),
  // Its name stands for it.
  block: [],
  entry: [
    [-6, 7],
    [-6, -7],
    [6, -7],
    [6, 7],
  ],
  transmitter: [
    [0, -20],
    [5, -10],
    [-5, -10],
  ],
  position: [
    [0, 0],
    [-7, -12],
    [-4, -19],
    [4, -19],
    [7, -12],
  ],
  own: [
    [0, -12],
    [6, -3],
    [6, 9],
    [-6, 9],
    [-6, -3],
  ],
  home: [
    [0, -10],
    [10, -1],
    [7, -1],
    [7, 8],
    [-7, 8],
    [-7, -1],
    [-10, -1],
  ],
};

const FILLS: Partial<Record<PlaceMark["sign"], string>> = {
  goal: "#ffd24d",
  position: "#e0452f",
  own: "#3aa0ff",
};

function paintMark(
  context: CanvasRenderingContext2D,
  at: Projection,
  { at: place, sign, words, radius_m, bow_deg = 0, old = false }: PlaceMark,
  side: Side | null,
  paper: Paper,
): void {
  if (radius_m > 0) {
    const dash = sign === "transmitter" ? [2, 6] : [9, 5];
    line(context, at, circle(place, radius_m, 96), { colour: paper.casing, width: 4, opacity: 0.6 });
    line(context, at, circle(place, radius_m, 96), { colour: paper.ink, width: 2, dash });
  }
  const [sin, cos] = [Math.sin((bow_deg * Math.PI) / 180), Math.cos((bow_deg * Math.PI) / 180)];
  context.beginPath();
  SIGNS[sign].forEach(([x, y], i) => {
    const [px, py] = [at.x(place[0]) + x * cos - y * sin, at.y(place[1]) + x * sin + y * cos];
    if (i === 0) context.moveTo(px, py);
    else context.lineTo(px, py);
  });
  context.closePath();
  context.fillStyle = old ? paper.casing : (FILLS[sign] ?? paper.casing);
  context.fill();
  stroke(context, { colour: paper.ink, width: 2 });
  label(context, at, place, words, side, paper);
}

function paintSketch(context: CanvasRenderingContext2D, at: Projection, { lines, handles }: Sketch): void {
  for (const ring of lines) {
    context.beginPath();
    trace(context, at, ring);
    context.globalAlpha = 0.18;
    context.fillStyle = SKETCH;
    context.fill();
    stroke(context, { colour: SKETCH, width: 3 });
  }
  for (const { at: place, strong } of handles) {
    const edge = { colour: SKETCH, width: 2, opacity: strong ? 1 : 0.7 };
    dot(context, at, place, strong ? 6.5 : 4, strong ? "#ffffff" : "#cfe0ee", edge);
  }
}
