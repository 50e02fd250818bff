/** Lines and rings of places on a sheet. */

import type { LngLat, Place } from "../../api/types";
import { simplified } from "./polylines";
import type { Projection } from "./projection";

export interface Stroke {
  colour: string;
  width: number;
  opacity?: number;
  dash?: number[];
}

/** Begins a path through places; nothing is drawn yet. */
export function trace(
  context: CanvasRenderingContext2D,
  at: Projection,
  places: readonly Place[],
  closed = false,
): void {
  const points = simplified(places.length, (i) => {
    const place = places[i] as Place;
    return [at.x(place[0]), at.y(place[1])];
  });
  points.forEach(([x, y], i) => {
    if (i === 0) context.moveTo(x, y);
    else context.lineTo(x, y);
  });
  if (closed) context.closePath();
}

export function stroke(
  context: CanvasRenderingContext2D,
  { colour, width, opacity = 1, dash = [] }: Stroke,
): void {
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.globalAlpha = opacity;
  context.setLineDash(dash);
  context.stroke();
  context.globalAlpha = 1;
}

export function line(
  context: CanvasRenderingContext2D,
  at: Projection,
  places: readonly Place[],
  how: Stroke,
  closed = false,
): void {
  context.beginPath();
  trace(context, at, places, closed);
  stroke(context, how);
}

export function dot(
  context: CanvasRenderingContext2D,
  at: Projection,
  [lng, lat]: LngLat,
  radius: number,
  fill: string,
  edge: Stroke,
): void {
  context.beginPath();
  context.arc(at.x(lng), at.y(lat), radius, 0, 2 * Math.PI);
  context.fillStyle = fill;
  context.fill();
  stroke(context, edge);
}

/** A vehicle's way: coloured, on a casing that parts it from whatever lies below. */
export function way(
  context: CanvasRenderingContext2D,
  at: Projection,
  { points, colour }: { points: readonly Place[]; colour: string },
  casing: string,
): void {
  context.beginPath();
  trace(context, at, points);
  stroke(context, { colour: casing, width: 4.5, opacity: 0.65 });
  stroke(context, { colour, width: 2 });
}
