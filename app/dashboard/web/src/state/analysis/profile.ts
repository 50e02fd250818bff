/** Maps cut along a line: what a chart of them shows, and the same as a table. Pure. */

import type { LngLat, ProfileView } from "../../api/types";
import { placeOf, typedPlace } from "../coordinates";

/** One survey along the line; `name` tells it from others in words. */
export interface Cut {
  id: string;
  name: string;
  colour: string;
  profile: ProfileView;
}

/** A depth of the chart, with its band of two deviations. */
export interface CutPoint {
  along_m: number;
  depth_m: number;
  sd_m: number;
}

/** A piece of a profile without a gap, measured or guessed throughout. */
export interface Piece {
  sounded: boolean;
  points: CutPoint[];
}

/** Where nothing is known, or the deviation reaches `none_m`, nothing is drawn; a guess is a piece of its own. */
export function piecesOf(profile: ProfileView, none_m: number): Piece[] {
  const pieces: Piece[] = [];
  let open: Piece | null = null;
  profile.along_m.forEach((along_m, i) => {
    const depth_m = profile.depth_m[i] ?? null;
    const sd_m = profile.sd_m[i] ?? null;
    const sounded = profile.sounded[i] ?? false;
    if (depth_m === null || sd_m === null || (!sounded && sd_m >= none_m)) {
      open = null;
      return;
    }
    const point = { along_m, depth_m, sd_m };
    if (open?.sounded !== sounded) {
      // Pieces that touch share a point, so that the line has no hole where its kind changes.
      const before: CutPoint | undefined = open?.points.at(-1);
      open = { sounded, points: before ? [before] : [] };
      pieces.push(open);
    }
    open.points.push(point);
  });
  return pieces;
}

/** Least and largest of what is drawn, with some room; null where nothing is. */
export function depthsOf(cuts: readonly Cut[], none_m: number): { low: number; high: number } | null {
  let [low, high] = [Infinity, -Infinity];
  for (const { profile } of cuts) {
    for (const { points } of piecesOf(profile, none_m)) {
      for (const { depth_m, sd_m } of points) {
        low = Math.min(low, depth_m - 2 * sd_m);
        high = Math.max(high, depth_m + 2 * sd_m);
      }
    }
    for (const { depth_m } of profile.soundings) {
      low = Math.min(low, depth_m);
      high = Math.max(high, depth_m);
    }
  }
  if (low > high) return null;
  const room = Math.max(0.05 * (high - low), 0.05);
  return { low: low - room, high: high + room };
}

/** At most about `most` round values between two ends. */
export function ticksOf(low: number, high: number, most: number): number[] {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5, 10].find((one) => one * power >= rough) ?? 10);
  const ticks: number[] = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n++)
    ticks.push(Number((n * step).toPrecision(12)));
  return ticks;
}

/** The point of a profile that is nearest to a way along the line. */
export function nearestIndex(along_m: readonly number[], wanted_m: number): number {
  const last = along_m.length - 1;
  const length = along_m[last] ?? 0;
  return length > 0 ? Math.round(Math.min(Math.max(wanted_m / length, 0), 1) * last) : 0;
}

/** Both surveys where they know the bottom: how much deeper the second is. */
export function differenceAlong(one: ProfileView, other: ProfileView): (number | null)[] {
  return one.along_m.map((_, i) => {
    const [a, b] = [one.depth_m[i], other.depth_m[i]];
    return a == null || b == null ? null : b - a;
  });
}

const HEAD = ["mission", "kind", "along_m", "across_m", "longitude_deg", "latitude_deg", "depth_m", "sd_m"];

/** A name that a table's cell can hold; what spreadsheets would take for a formula stays text. */
const cell = (text: string) => {
  const safe = /^[=+\-@\t\r]/.test(text) ? `'${text}` : text;
  return /[",\n\r]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
};

/** All of it as comma-separated values with points in numbers, whatever the language: files are for programs. */
export function csvOf(cuts: readonly Cut[]): string {
  const layers = [...new Set(cuts.flatMap(({ profile }) => Object.keys(profile.layers)))];
  const rows: (string | number | null)[][] = [[...HEAD, "state", ...layers]];
  for (const { profile } of cuts) {
    profile.along_m.forEach((along_m, i) => {
      const [lng, lat] = profile.positions[i] as LngLat;
      const depth_m = profile.depth_m[i] ?? null;
      const state = depth_m === null ? "unknown" : profile.sounded[i] ? "sounded" : "interpolated";
      const values = layers.map((name) => profile.layers[name]?.[i] ?? null);
      rows.push([
        profile.name,
        "map",
        along_m,
        0,
        lng,
        lat,
        depth_m,
        profile.sd_m[i] ?? null,
        state,
        ...values,
      ]);
    });
    for (const one of profile.soundings) {
      const { along_m, across_m, depth_m, sd_m } = one;
      rows.push([
        profile.name,
        "sounding",
        along_m,
        across_m,
        null,
        null,
        depth_m,
        sd_m,
        "sounded",
        ...layers.map(() => null),
      ]);
    }
  }
  const written = rows.map((row) =>
    row.map((value) => (value === null ? "" : typeof value === "string" ? cell(value) : value)).join(","),
  );
  return `${written.join("\r\n")}\r\n`;
}

/** The corners of a line as the service takes them. */
export const lineText = (corners: readonly LngLat[]): string =>
  corners.map(([lng, lat]) => `${lng.toFixed(7)},${lat.toFixed(7)}`).join(";");

/** A line as it is typed: places, latitude first, with semicolons between them; null when it is none. */
export function typedLine(text: string): LngLat[] | null {
  const places = text
    .split(";")
    .filter((part) => part.trim() !== "")
    .map(placeOf);
  if (places.length < 2 || places.some((one) => one === null)) return null;
  return places as LngLat[];
}

export const lineTyped = (corners: readonly LngLat[]): string => corners.map(typedPlace).join("; ");
