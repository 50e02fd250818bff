/** Which points on the screen lie within a line drawn round them. Pure. */

import type { Pixel } from "../canvas/polylines";

/** Places in `screen` (x, y, x, y, …; NaN: not on it) that lie within a ring, by how often it winds past them. */
export function within(screen: Float32Array, ring: readonly Pixel[]): number[] {
  if (ring.length < 3) return [];
  const xs = ring.map(([x]) => x);
  const ys = ring.map(([, y]) => y);
  const [west, east] = [Math.min(...xs), Math.max(...xs)];
  const [top, bottom] = [Math.min(...ys), Math.max(...ys)];
  const found: number[] = [];
  for (let i = 0; 2 * i < screen.length; i++) {
    const [x, y] = [screen[2 * i] as number, screen[2 * i + 1] as number];
    // Not a number fails every comparison.
    if (!(x >= west && x <= east && y >= top && y <= bottom)) continue;
    if (isInside(x, y, xs, ys)) found.push(i);
  }
  return found;
}

function isInside(x: number, y: number, xs: readonly number[], ys: readonly number[]): boolean {
  let inside = false;
  for (let i = 0, j = xs.length - 1; i < xs.length; j = i++) {
    const [xi, yi, xj, yj] = [xs[i], ys[i], xs[j], ys[j]] as [number, number, number, number];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) inside = !inside;
  }
  return inside;
}

const SIDES = 32;

/** A round frame, which the keyboard moves. */
export function frameRing({ x, y, radius }: { x: number; y: number; radius: number }): Pixel[] {
  return [...Array(SIDES).keys()].map((k) => {
    const turn = (2 * Math.PI * k) / SIDES;
    return [x + radius * Math.cos(turn), y + radius * Math.sin(turn)];
  });
}
