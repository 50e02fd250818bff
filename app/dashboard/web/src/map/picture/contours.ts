/** Lines of equal depth, by marching squares over the cells' centres. Pure; runs in a worker. */

import { niceStep } from "./palette";
import { UNKNOWN } from "./seafloor";

/** A line through grid coordinates: column and row with fractions, cell centres at halves. */
export interface Contour {
  level: number;
  points: [col: number, row: number][];
}

const ABOUT = 10;

/** A pleasant distance between contours for depths in this range. */
export function contourInterval(low: number, high: number): number {
  return niceStep(Math.max(high - low, 0.1) / ABOUT);
}

/** Contours at whole multiples of `interval`, all in the layer's whole numbers. */
export function contours(values: Int32Array, rows: number, cols: number, interval: number): Contour[] {
  let low = Number.POSITIVE_INFINITY;
  let high = Number.NEGATIVE_INFINITY;
  for (const value of values) {
    if (value === UNKNOWN) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  const found: Contour[] = [];
  for (let n = Math.ceil(low / interval); n * interval <= high; n++) {
    for (const points of linesAt(values, rows, cols, n * interval))
      found.push({ level: n * interval, points });
  }
  return found;
}

/** Edges of the lattice of centres: horizontal ones are even, vertical ones odd. */
const across = (cols: number, row: number, col: number) => 2 * (row * cols + col);
const up = (cols: number, row: number, col: number) => 2 * (row * cols + col) + 1;

function linesAt(values: Int32Array, rows: number, cols: number, level: number): Contour["points"][] {
  const links = new Map<number, number[]>();
  const link = (a: number, b: number) => {
    const of = (edge: number, other: number) => {
      const known = links.get(edge);
      if (known) known.push(other);
      else links.set(edge, [other]);
    };
    of(a, b);
    of(b, a);
  };
  for (let row = 0; row + 1 < rows; row++) {
    for (let col = 0; col + 1 < cols; col++) {
      const at = row * cols + col;
      const sw = values[at] as number;
      const se = values[at + 1] as number;
      const nw = values[at + cols] as number;
      const ne = values[at + cols + 1] as number;
      if (sw === UNKNOWN || se === UNKNOWN || nw === UNKNOWN || ne === UNKNOWN) continue;
      const kind =
        (sw >= level ? 1 : 0) | (se >= level ? 2 : 0) | (ne >= level ? 4 : 0) | (nw >= level ? 8 : 0);
      if (kind === 0 || kind === 15) continue;
      const south = across(cols, row, col);
      const north = across(cols, row + 1, col);
      const west = up(cols, row, col);
      const east = up(cols, row, col + 1);
      switch (kind) {
        case 1:
        case 14:
          link(south, west);
          break;
        case 2:
        case 13:
          link(south, east);
          break;
        case 4:
        case 11:
          link(north, east);
          break;
        case 8:
        case 7:
          link(north, west);
          break;
        case 3:
        case 12:
          link(west, east);
          break;
        case 6:
        case 9:
          link(south, north);
          break;
        default: {
          // A saddle: the mean of the four decides which corners belong together.
          const high = (sw + se + nw + ne) / 4 >= level;
          if ((kind === 5) === high) {
            link(south, east);
            link(north, west);
          } else {
            link(south, west);
            link(north, east);
          }
        }
      }
    }
  }
  const place = (edge: number): [number, number] => {
    const at = edge >> 1;
    const row = Math.floor(at / cols);
    const col = at % cols;
    const here = values[at] as number;
    const there = values[edge % 2 === 0 ? at + 1 : at + cols] as number;
    const part = here === there ? 0.5 : (level - here) / (there - here);
    return edge % 2 === 0 ? [col + part + 0.5, row + 0.5] : [col + 0.5, row + part + 0.5];
  };
  return chains(links).map((chain) => chain.map(place));
}

/** Joins links into lines, open ones first; each link is used once. */
function chains(links: Map<number, number[]>): number[][] {
  const found: number[][] = [];
  const walk = (start: number) => {
    const chain = [start];
    let here = start;
    for (;;) {
      const next = links.get(here)?.pop();
      if (next === undefined) break;
      const back = links.get(next);
      back?.splice(back.indexOf(here), 1);
      chain.push(next);
      here = next;
    }
    if (chain.length > 1) found.push(chain);
  };
  for (const [edge, others] of links) if (others.length === 1) walk(edge);
  for (const edge of links.keys()) walk(edge);
  return found;
}
