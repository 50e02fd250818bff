/** A measured sound speed profile as a file has it: depth and speed on each line, whatever stands around them. Pure. */

export type Profile = [depth_m: number, speed_mps: number][];

/** More depths than this the service does not take. */
const MOST = 2000;

/**
 * The depths with their speeds, from top to bottom; lines that do not begin with two numbers are headings. A comma is a
 * decimal one where semicolons or tabs part the columns. Of several profiles one after the other the longest counts,
 * of a cast down and up the way down.
 */
export function profileOf(text: string): Profile {
  const blocks: Profile[] = [[]];
  for (const line of text.split(/\r?\n/)) {
    const row = rowOf(line);
    if (row) blocks.at(-1)?.push(row);
    else if (line.trim() !== "" && blocks.at(-1)?.length) blocks.push([]);
  }
  const longest = blocks.reduce((a, b) => (b.length > a.length ? b : a));
  const deepest = longest.reduce((at, [depth_m], i) => (depth_m > (longest[at]?.[0] ?? 0) ? i : at), 0);
  const down = deepest === 0 ? longest.toReversed() : longest.slice(0, deepest + 1);
  let reached_m = Number.NEGATIVE_INFINITY;
  const deeper = down.filter(([depth_m]) => {
    if (depth_m <= reached_m) return false;
    reached_m = depth_m;
    return true;
  });
  const every = Math.ceil(deeper.length / MOST);
  return deeper.filter((_, i) => i % every === 0);
}

function rowOf(line: string): Profile[number] | null {
  const plain = /[;\t]/.test(line) ? line.replaceAll(",", ".") : line;
  const [depth_m = Number.NaN, speed_mps = Number.NaN] = plain
    .trim()
    .split(/[\s,;]+/)
    .map((part) => (part === "" ? Number.NaN : Number(part)));
  return Number.isFinite(depth_m) && Number.isFinite(speed_mps) ? [depth_m, speed_mps] : null;
}

/** The least and the largest depth and speed. */
export function profileEnds(profile: Readonly<Profile>): {
  depths: readonly [number, number];
  speeds: readonly [number, number];
} {
  const depths = profile.map(([depth_m]) => depth_m);
  const speeds = profile.map(([, speed_mps]) => speed_mps);
  return {
    depths: [Math.min(...depths), Math.max(...depths)],
    speeds: [Math.min(...speeds), Math.max(...speeds)],
  };
}
