/** The names of harbours on a map that shows more than the survey: few, where nothing else is written. */

import type { Harbour } from "../harbours";
import { type Box, boxOf, type Label, namesFitting, type Side } from "./labels";
import type { Paper } from "./mapColours";
import type { Projection } from "./projection";
import { dot } from "./shapes";

/** From this zoom on a minute, to which most are known, is too far. */
const GONE_ZOOM = 12;
/** From each of these zooms on harbours of the next smaller size are named, too. */
const SMALLER_FROM_ZOOMS = [5, 7, 8.5];
const LARGEST = 3;
const MOST_NAMES = 24;
const FONT = "italic 12px sans-serif";
const HEIGHT_PX = 15;
const REACH_PX = 6;

export const showsHarbours = (zoom: number): boolean => zoom < GONE_ZOOM;

export interface LaidName extends Label {
  key: string;
  words: string;
}

/** The largest harbours in the window of whose names there is room beside what is `taken`; `before`: sides by their keys. */
export function laidNames(
  context: CanvasRenderingContext2D,
  at: Projection,
  harbours: readonly Harbour[],
  taken: readonly Box[],
  before: ReadonlyMap<string, Side>,
): LaidName[] {
  const seen = seenOf(harbours, at);
  if (seen.length === 0) return [];
  context.font = FONT;
  const labels = seen.map(({ at: [lng, lat], name }) => {
    const key = `harbour-${name}-${lng}-${lat}`;
    return {
      key,
      words: name,
      at: [at.x(lng), at.y(lat)] as [number, number],
      width: context.measureText(name).width,
      height: HEIGHT_PX,
      reach: REACH_PX,
      side: before.get(key) ?? ("right" as const),
    };
  });
  const sides = namesFitting(labels, taken, at.width, at.height);
  return labels.flatMap((label, i) => {
    const side = sides[i];
    return side ? [{ ...label, side }] : [];
  });
}

/** On which side of its sign each name is, by its key. */
export const sidesOf = (names: readonly LaidName[]) => names.map(({ key, side }) => [key, side] as const);

/** The largest harbours in a window, as many as may be named; `harbours` begins with the largest. Pure. */
export function seenOf(harbours: readonly Harbour[], at: Projection): Harbour[] {
  const { zoom } = at.camera;
  if (!showsHarbours(zoom)) return [];
  const least = LARGEST - SMALLER_FROM_ZOOMS.filter((from) => zoom >= from).length;
  const [west, north] = at.place(0, 0);
  const [east, south] = at.place(at.width, at.height);
  const seen: Harbour[] = [];
  for (const harbour of harbours) {
    if (harbour.size < least || seen.length === MOST_NAMES) break;
    const [lng, lat] = harbour.at;
    if (lng >= west && lng <= east && lat >= south && lat <= north) seen.push(harbour);
  }
  return seen;
}

export function paintNames(
  context: CanvasRenderingContext2D,
  at: Projection,
  names: readonly LaidName[],
  paper: Paper,
): void {
  context.font = FONT;
  context.textAlign = "start";
  context.textBaseline = "middle";
  context.lineJoin = "round";
  for (const name of names) {
    const [x, y] = name.at;
    dot(context, at, at.place(x, y), 2.5, paper.ink, { colour: paper.casing, width: 1.5 });
    const { left, top, bottom } = boxOf(name, name.side);
    context.setLineDash([]);
    context.lineWidth = 3;
    context.strokeStyle = paper.casing;
    context.strokeText(name.words, left, (top + bottom) / 2);
    context.fillStyle = paper.ink;
    context.fillText(name.words, left, (top + bottom) / 2);
  }
}
