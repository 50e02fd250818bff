/** The site of a search: what is known of each cell, as a picture, and the places that matter. Pure but for atob. */

import type { LngLat, SearchGridView } from "../../api/types";
import { say } from "../../words/say";
import type { PlaceMark } from "./marks";

/** What is known of a cell, as the service counts. */
export const CELL = { explored: 1, unexplored: 2, known: 3, found: 4 } as const;

export const SITE_COLOURS: Readonly<Record<keyof typeof CELL, readonly [number, number, number, number]>> = {
  explored: [87, 166, 116, 70],
  unexplored: [16, 28, 36, 120],
  known: [74, 66, 60, 255],
  found: [217, 72, 15, 255],
};

export const SITE_WORDS: Readonly<Record<keyof typeof CELL, string>> = {
  get explored() {
    return say("site.lookedAtFree");
  },
  get unexplored() {
    return say("site.notLookedAt");
  },
  get known() {
    return say("site.obstacleOnThePlan");
  },
  get found() {
    return say("site.obstacleFound");
  },
};

export interface Site {
  version: number;
  corners: readonly LngLat[];
  rows: number;
  cols: number;
  /** Rows from south to north. */
  cells: Uint8Array;
}

export function siteOf(answer: SearchGridView): Site {
  const { version, corners, rows, cols } = answer;
  const bytes = atob(answer.cells);
  const cells = Uint8Array.from(bytes, (letter) => letter.charCodeAt(0));
  if (cells.length !== rows * cols) throw new Error(`${cells.length} cells came for ${rows} x ${cols}`);
  return { version, corners: corners as LngLat[], rows, cols, cells };
}

/** A pixel per cell, north up. */
export function sitePicture({ rows, cols, cells }: Site): {
  pixels: Uint8ClampedArray<ArrayBuffer>;
  width: number;
  height: number;
} {
  const colours = Object.entries(CELL).reduce<(readonly number[])[]>((table, [name, code]) => {
    table[code] = SITE_COLOURS[name as keyof typeof CELL];
    return table;
  }, []);
  const pixels = new Uint8ClampedArray(rows * cols * 4);
  for (let row = 0; row < rows; row++) {
    for (let col = 0; col < cols; col++) {
      const colour = colours[cells[row * cols + col] ?? 0];
      if (colour) pixels.set(colour, ((rows - 1 - row) * cols + col) * 4);
    }
  }
  return { pixels, width: cols, height: rows };
}

interface Places {
  goal: readonly [number, number];
  goal_radius_m: number;
  entry: readonly [number, number];
  transmitter: readonly [number, number] | null;
  transmitter_range_m: number;
}

export function searchMarks(search: Places): PlaceMark[] {
  const { goal, entry, transmitter } = search;
  const marks: PlaceMark[] = [
    { words: say("mission.goal"), sign: "goal", at: [goal[0], goal[1]], radius_m: search.goal_radius_m },
    { words: say("mission.entry"), sign: "entry", at: [entry[0], entry[1]], radius_m: 0 },
  ];
  const mast = transmitter ?? entry;
  marks.push({
    words: transmitter ? say("site.transmitter") : "",
    sign: "transmitter",
    at: [mast[0], mast[1]],
    radius_m: search.transmitter_range_m,
  });
  return marks;
}
