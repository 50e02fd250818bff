/** Lines of a line plan on the map. Pure. */

import type { LngLat, SurveyLine } from "../../api/types";

export interface NamedLine {
  name: string;
  places: readonly LngLat[];
}

export const namedLines = (lines: readonly SurveyLine[]): NamedLine[] =>
  lines.map(({ name, coordinates }) => ({ name, places: coordinates as LngLat[] }));
