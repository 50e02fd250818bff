/** Light and shadow of a sea floor. Pure; as the service makes them for its own pictures. */

/** Where light comes from on charts, degrees from north. */
export const NORTH_WEST_DEG = 315;
const HEIGHT_RAD = Math.PI / 4;
const MOST_EXAGGERATED = 10;
/** Of the steeper slopes after heights were exaggerated. */
const STEEP = 0.5;
/** Of all cells that have a slope: steeper ones are left out of account. */
const STEEPER = 0.9;
/** Slopes that the exaggeration is found from are as many as this at most. */
const LOOKED_AT = 20_000;

/**
 * How much light falls on each cell: 1 on level ground, less in shadow, more where it faces the light. `depths` in
 * units of which `cell` make a cell's side, row 0 south; `weight` (0 to 1) is how much each is to be believed: beside a
 * cell that is not, nothing is steep.
 */
export function hillshade(
  depths: Int32Array,
  weight: Float32Array,
  rows: number,
  cols: number,
  cell: number,
  azimuth_deg: number,
): Float32Array {
  const east = new Float32Array(rows * cols);
  const north = new Float32Array(rows * cols);
  const believed = new Float32Array(rows * cols);
  const along = (into: Float32Array, at: number, step: number, before: boolean, after: boolean): number => {
    const here = depths[at] as number;
    const ahead = after && (weight[at + step] as number) > 0;
    const behind = before && (weight[at - step] as number) > 0;
    const high = ahead ? (depths[at + step] as number) : here;
    const low = behind ? (depths[at - step] as number) : here;
    into[at] = ahead || behind ? (high - low) / ((ahead && behind ? 2 : 1) * cell) : 0;
    return Math.min(ahead ? (weight[at + step] as number) : 1, behind ? (weight[at - step] as number) : 1);
  };
  for (let row = 0; row < rows; row++) {
    for (let col = 0; col < cols; col++) {
      const at = row * cols + col;
      if (weight[at] === 0) continue;
      const sideways = along(east, at, 1, col > 0, col + 1 < cols);
      const upward = along(north, at, cols, row > 0, row + 1 < rows);
      believed[at] = Math.min(weight[at] as number, sideways, upward);
    }
  }
  const times = exaggeration(east, north, believed);
  const azimuth = (azimuth_deg * Math.PI) / 180;
  const [fromEast, fromNorth] = [
    Math.sin(azimuth) * Math.cos(HEIGHT_RAD),
    Math.cos(azimuth) * Math.cos(HEIGHT_RAD),
  ];
  const up = Math.sin(HEIGHT_RAD);
  const light = new Float32Array(rows * cols).fill(1);
  for (let at = 0; at < light.length; at++) {
    if (believed[at] === 0) continue;
    const [e, n] = [times * (east[at] as number), times * (north[at] as number)];
    // The normal of a floor whose depth grows to the east leans to the east.
    const lit = Math.max(0, (e * fromEast + n * fromNorth + up) / Math.sqrt(1 + e * e + n * n) / up);
    light[at] = 1 + (lit - 1) * (believed[at] as number);
  }
  return light;
}

/** By how much heights are exaggerated so that a floor shows its form: 1 on steep ones, more on flat ones. */
function exaggeration(east: Float32Array, north: Float32Array, believed: Float32Array): number {
  const every = Math.max(1, Math.floor(east.length / LOOKED_AT));
  const slopes: number[] = [];
  for (let at = 0; at < east.length; at += every) {
    if ((believed[at] as number) > 0) slopes.push(Math.hypot(east[at] as number, north[at] as number));
  }
  slopes.sort((a, b) => a - b);
  const steep = slopes[Math.floor(STEEPER * (slopes.length - 1))] ?? 0;
  return steep > 0 ? Math.min(MOST_EXAGGERATED, Math.max(1, Math.round(STEEP / steep))) : 1;
}
