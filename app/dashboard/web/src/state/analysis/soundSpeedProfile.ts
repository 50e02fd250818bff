/** A measured sound speed profile as a file has it: depth and speed on each line, whatever stands around them. Pure. */

export type Profile = [depth_m: number, speed_mps: number][];

/**
 * The depths with their speeds, from top to bottom; lines that do not begin with two numbers are headings. A comma is a
 * decimal one where semicolons part the columns.
 */
export function profileOf(text: string): Profile {
  const rows = text.split(/\r?\n/).flatMap((line): Profile => {
    const plain = line.includes(";") ? line.replaceAll(",", ".") : line;
    const [depth_m, speed_mps] = plain
      .trim()
      .split(/[\s,;]+/)
      .map((part) => (part === "" ? Number.NaN : Number(part))) as [number, number | undefined];
    return Number.isFinite(depth_m) && speed_mps !== undefined && Number.isFinite(speed_mps)
      ? [[depth_m, speed_mps]]
      : [];
  });
  return rows.sort(([a], [b]) => a - b);
}

/** "0 to 20 m, 1506.1 to 1512.3 m/s"; the ends alone where all is the same. */
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
