/** Lines of a line plan on a sheet, each with its name where there is room for it. */

import type { NamedLine } from "../marks/lines";
import type { Paper } from "./mapColours";
import { labelPlaces, type Pixel } from "./polylines";
import type { Projection } from "./projection";
import { stroke, trace } from "./shapes";

const LABEL_PX = 11;
/** Free room around a name. */
const PADDING_PX = 4;
/** So far off the vertical names begin to read from left to right, radians. */
const LEANING = 0.1;

export function paintPlannedLines(
  context: CanvasRenderingContext2D,
  at: Projection,
  lines: readonly NamedLine[],
  paper: Paper,
): void {
  if (lines.length === 0) return;
  context.beginPath();
  for (const { places } of lines) trace(context, at, places);
  stroke(context, { colour: paper.casing, width: 3, opacity: 0.5 });
  stroke(context, { colour: paper.area, width: 1, dash: [10, 4], opacity: 0.85 });
  context.font = `600 ${LABEL_PX}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  const taken: { x: number; y: number; radius: number }[] = [];
  for (const { name, places } of lines) {
    const points = places.map(([lng, lat]): Pixel => [at.x(lng), at.y(lat)]);
    const width = context.measureText(name).width;
    const radius = Math.max(LABEL_PX, width / 2) + PADDING_PX;
    // In its middle: beside each other names of a plan's lines stand in a row.
    const [middle] = labelPlaces(points, width, lengthOf(points));
    if (!middle || middle.x < 0 || middle.y < 0 || middle.x > at.width || middle.y > at.height) continue;
    if (taken.some(({ x, y, radius: r }) => Math.hypot(x - middle.x, y - middle.y) < r + radius)) continue;
    taken.push({ x: middle.x, y: middle.y, radius });
    context.save();
    context.translate(middle.x, middle.y);
    context.rotate(upright(middle.angle));
    context.lineWidth = 3.2;
    context.setLineDash([]);
    context.strokeStyle = paper.casing;
    context.strokeText(name, 0, 0);
    context.fillStyle = paper.area;
    context.fillText(name, 0, 0);
    context.restore();
  }
}

/** Lines to the north, which are never quite that, all read upwards. */
const upright = (angle: number): number => (angle > Math.PI / 2 - LEANING ? angle - Math.PI : angle);

const lengthOf = (points: readonly Pixel[]): number =>
  points.slice(1).reduce((sum, [x, y], i) => {
    const [x0, y0] = points[i] as Pixel;
    return sum + Math.hypot(x - x0, y - y0);
  }, 0);
