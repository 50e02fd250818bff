/** Lines as they are worth drawing: without the points that nobody sees, and with places for their labels. Pure. */

export type Pixel = [x: number, y: number];

/**
 * A line without the points that lie closer than `tolerance` to what is drawn without them. One pass: from the last
 * kept point a cone is narrowed by every further point until one lies outside.
 */
export function simplified(count: number, at: (index: number) => Pixel, tolerance = 0.4): Pixel[] {
  if (count === 0) return [];
  let from = at(0);
  const kept = [from];
  let last = from;
  let middle = 0;
  let low = Number.NEGATIVE_INFINITY;
  let high = Number.POSITIVE_INFINITY;
  let reach = 0;
  for (let i = 1; i < count; i++) {
    const to = at(i);
    let away = Math.hypot(to[0] - from[0], to[1] - from[1]);
    let turn = 0;
    if (reach > 0 && away > 0) {
      turn = Math.atan2(to[1] - from[1], to[0] - from[0]) - middle;
      turn -= 2 * Math.PI * Math.round(turn / (2 * Math.PI));
    }
    // Outside of the cone, or on the way back: the point before is needed.
    if (reach > 0 && (turn < low || turn > high || away < reach - tolerance)) {
      kept.push(last);
      from = last;
      reach = 0;
      away = Math.hypot(to[0] - from[0], to[1] - from[1]);
    }
    last = to;
    if (away <= tolerance) continue;
    const spread = Math.asin(tolerance / away);
    if (reach === 0) {
      middle = Math.atan2(to[1] - from[1], to[0] - from[0]);
      low = -spread;
      high = spread;
    } else {
      low = Math.max(low, turn - spread);
      high = Math.min(high, turn + spread);
    }
    reach = Math.max(reach, away);
  }
  if (last !== kept.at(-1)) kept.push(last);
  return kept;
}

export interface LabelPlace {
  x: number;
  y: number;
  /** Radians, such that the text is upright. */
  angle: number;
}

/** Places along a line, `spacing` apart, where a text of this width follows it nearly straight. */
export function labelPlaces(points: readonly Pixel[], width: number, spacing: number): LabelPlace[] {
  const found: LabelPlace[] = [];
  let until = spacing / 2;
  for (let i = 1; i < points.length; i++) {
    const [x0, y0] = points[i - 1] as Pixel;
    const [x1, y1] = points[i] as Pixel;
    const length = Math.hypot(x1 - x0, y1 - y0);
    if (until > length) {
      until -= length;
      continue;
    }
    const start = along(points, i, until - width / 2);
    const end = along(points, i, until + width / 2);
    const share = until / length;
    until = spacing - (length - until);
    if (!start || !end) continue;
    const chord = Math.hypot(end[0] - start[0], end[1] - start[1]);
    if (chord < 0.92 * width) continue;
    let angle = Math.atan2(end[1] - start[1], end[0] - start[0]);
    if (Math.abs(angle) > Math.PI / 2) angle -= Math.sign(angle) * Math.PI;
    found.push({ x: x0 + share * (x1 - x0), y: y0 + share * (y1 - y0), angle });
  }
  return found;
}

/** The point of a line that lies so far behind the beginning of its i-th piece; null beyond its ends. */
function along(points: readonly Pixel[], i: number, distance: number): Pixel | null {
  let left = distance;
  let piece = i;
  for (;;) {
    const a = points[piece - 1];
    const b = points[piece];
    if (!a || !b) return null;
    const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
    if (left < 0) {
      piece -= 1;
      const before = points[piece - 1];
      if (!before) return null;
      left += Math.hypot(a[0] - before[0], a[1] - before[1]);
    } else if (left > length) {
      left -= length;
      piece += 1;
    } else {
      const share = length > 0 ? left / length : 0;
      return [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
    }
  }
}
