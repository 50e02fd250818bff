/** Lines of a line plan that a mission is to fly: how long they are, and where they lie. Pure. */

import type { DrawingView, LngLat, SurveyLine } from "../../api/types";
import { boundsOf, wayBetween } from "../../map/geo";
import type { Draft } from "./draft";
import { EVEN_LINES, LINE_HEADING } from "./plannerOptions";

const placesOf = (lines: readonly SurveyLine[]): LngLat[] =>
  lines.flatMap(({ coordinates }) => coordinates as LngLat[]);

export function lengthOf({ coordinates }: Pick<SurveyLine, "coordinates">): number {
  const places = coordinates as LngLat[];
  return places.slice(1).reduce((sum, place, i) => sum + wayBetween(places[i] as LngLat, place).metres, 0);
}

/** What changes with lines that come: they are flown to their ends, and nothing else says where lines lie. */
export function withLines(draft: Draft, lines: readonly SurveyLine[]): Partial<Draft> {
  const { line_spacing_m: _s, [LINE_HEADING]: _h, ...options } = draft.options;
  return { lines, planner: EVEN_LINES, until_lines: true, spacing_m: "", options };
}

export const withoutLines: Partial<Draft> = { lines: [], until_lines: false };

/** Lines as a file has them, to be flown in either direction. */
export const linesIn = ({ lines }: DrawingView): SurveyLine[] =>
  lines.map(({ name, coordinates }) => ({ name, coordinates, keep_direction: false }));

/**
 * Whether the area of a draft has nothing to do with lines that come: it lies elsewhere than all of them, or it is the
 * rectangle that a form begins with, or another typed one, which does not enclose them.
 */
export function liesElsewhere(
  draft: Pick<Draft, "source">,
  ring: readonly LngLat[],
  lines: readonly SurveyLine[],
) {
  if (near(lines, ring).length === 0) return true;
  const [area, around] = [boundsOf(ring), boundsOf(placesOf(lines))];
  return draft.source === "typed" && area !== null && around !== null && !isIn(around, area);
}

/** What a block flies of all lines: those that may reach into it; where none does all, which is refused with the reason. */
export function linesFor(lines: readonly SurveyLine[], ring: readonly LngLat[]): readonly SurveyLine[] {
  const found = near(lines, ring);
  return found.length > 0 ? found : lines;
}

function near(lines: readonly SurveyLine[], ring: readonly LngLat[]): SurveyLine[] {
  const area = boundsOf(ring);
  return lines.filter((line) => {
    const bounds = boundsOf(placesOf([line]));
    return area !== null && bounds !== null && meet(area, bounds);
  });
}

type Bounds = readonly [west: number, south: number, east: number, north: number];

const isIn = (one: Bounds, other: Bounds): boolean =>
  one[0] >= other[0] && one[1] >= other[1] && one[2] <= other[2] && one[3] <= other[3];

const meet = (one: Bounds, other: Bounds): boolean =>
  one[0] <= other[2] && other[0] <= one[2] && one[1] <= other[3] && other[1] <= one[3];

/**
 * How far each vehicle may fly so that all lines are flown for certain: ways between them, the line more that one may
 * have and the way to the first are in it. With the last line the mission ends.
 */
export function wayForPlan(lines: readonly SurveyLine[], vehicles: number): number {
  const lengths = lines.map(lengthOf);
  const total_m = lengths.reduce((sum, length) => sum + length, 0);
  const [west, south, east, north] = boundsOf(placesOf(lines)) ?? [0, 0, 0, 0];
  const across_m = wayBetween([west, south], [east, north]).metres;
  return (1.5 * total_m) / vehicles + Math.max(0, ...lengths) + 3 * across_m;
}
