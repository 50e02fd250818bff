/** Turns a layer into a picture: colours, light and shadow, and how sure the map is. Pure; runs in a worker. */

import { isMeasured, strengthOf } from "./certainty";
import { type Drawn, drawingOf } from "./drawings";
import { hillshade } from "./hillshade";
import { ACCURATE, UNKNOWN } from "./seafloor";

export interface Painting {
  rows: number;
  cols: number;
  /** Whole numbers, row 0 south. */
  values: Int32Array;
  flags: Int32Array;
  depths: Int32Array;
  /** Of the first and the last colour, in the layer's whole numbers. */
  low: number;
  high: number;
  /** 256 colours, three bytes each, or the name of a drawing of its own. */
  colours: Uint8Array | Drawn;
  /** Deviations of depths, and between which of them guesses fade; null: the layer is not of depths. */
  guesses: { sds: Int32Array; full: number; none: number } | null;
  /** Where light comes from, and how many of the depths' whole numbers are a cell's side; null: no light. */
  light: { azimuth_deg: number; cell: number } | null;
  /** The mission's area in columns and rows: cells that it cuts are filled up to its edge. */
  ring: readonly (readonly [col: number, row: number])[];
}

export interface Picture {
  width: number;
  height: number;
  pixels: Uint8ClampedArray<ArrayBuffer>;
  /** Opaque where depths are guessed, less sure than asked; null where the layer does not tell. */
  guessed: Uint8ClampedArray<ArrayBuffer> | null;
}

const DARKEST = 0.5;
const LIGHTEST = 1.6;
/** How much of what lies between a colour and white the brightest light adds, for each unit of it. */
const GLARE = 0.55;
/** Cells beyond the outermost known ones that smooth pictures need at the area's edge. */
const BEYOND = 2;

/** What is drawn fainter than this is neither hatched nor has contours. */
export const FAINT = 0.15;

/** How strongly each cell is drawn, 0 to 1; where the map knows nothing it is 0. */
export function strengths({ values, flags, guesses }: Pick<Painting, "values" | "flags" | "guesses">) {
  const found = new Float32Array(values.length);
  for (let at = 0; at < found.length; at++) {
    if (values[at] === UNKNOWN) continue;
    const sure = !guesses || isMeasured(flags[at] as number);
    found[at] = sure ? 1 : strengthOf(guesses.sds[at] as number, guesses.full, guesses.none);
  }
  return found;
}

/** The picture, a pixel for each cell, northern row first; cells without a value are transparent. */
export function paint(painting: Painting, strong = strengths(painting)): Picture {
  const { rows, cols, values, flags, depths, low, high, colours, guesses, light, ring } = painting;
  const table = typeof colours === "string" ? null : colours;
  const drawing = typeof colours === "string" ? drawingOf(colours) : null;
  const pixels = new Uint8ClampedArray(4 * rows * cols);
  const guessed = guesses && new Uint8ClampedArray(4 * rows * cols);
  const scale = 255 / Math.max(1e-9, high - low);
  const lit = light && hillshade(depths, strong, rows, cols, light.cell, light.azimuth_deg);
  for (let row = 0; row < rows; row++) {
    for (let col = 0; col < cols; col++) {
      const at = row * cols + col;
      const value = values[at] as number;
      if (value === UNKNOWN) continue;
      const index = table ? Math.round(Math.min(255, Math.max(0, (value - low) * scale))) : 0;
      const bright = lit ? Math.min(LIGHTEST, Math.max(DARKEST, lit[at] as number)) : 1;
      const into = 4 * ((rows - 1 - row) * cols + col);
      for (let i = 0; i < 3; i++) {
        const part = table
          ? (table[3 * index + i] as number)
          : (drawing?.colours[drawing.classOf(value)]?.[i] as number);
        pixels[into + i] = bright < 1 ? part * bright : part + (255 - part) * (bright - 1) * GLARE;
      }
      pixels[into + 3] = 255 * (strong[at] as number);
      const flag = flags[at] as number;
      if (guessed && !isMeasured(flag) && !(flag & ACCURATE) && (strong[at] as number) >= FAINT) {
        guessed[into + 3] = 255;
      }
    }
  }
  if (ring.length > 0) {
    const inside = cellsIn(ring, rows, cols);
    spread(pixels, inside, rows, cols);
    if (guessed) spread(guessed, inside, rows, cols);
  }
  return { width: cols, height: rows, pixels, guessed };
}

/** Which cells have their middle in a ring, row by row from the south. */
export function cellsIn(ring: Painting["ring"], rows: number, cols: number): Uint8Array {
  const inside = new Uint8Array(rows * cols);
  for (let row = 0; row < rows; row++) {
    const y = row + 0.5;
    const crossings = ring.flatMap(([x1, y1], i) => {
      const [x2, y2] = ring[(i + 1) % ring.length] as readonly [number, number];
      return y1 > y !== y2 > y ? [x1 + ((y - y1) / (y2 - y1)) * (x2 - x1)] : [];
    });
    crossings.sort((a, b) => a - b);
    for (let i = 0; i + 1 < crossings.length; i += 2) {
      const from = Math.max(0, Math.ceil((crossings[i] as number) - 0.5));
      const to = Math.min(cols - 1, Math.floor((crossings[i + 1] as number) - 0.5));
      if (to >= from) inside.fill(1, row * cols + from, row * cols + to + 1);
    }
  }
  return inside;
}

/** Gives cells outside of the area the mean of their neighbours, so that the picture reaches the area's edge. */
function spread(pixels: Uint8ClampedArray, inside: Uint8Array, rows: number, cols: number): void {
  for (let round = 0; round < BEYOND; round++) {
    const before = pixels.slice();
    for (let row = 0; row < rows; row++) {
      for (let col = 0; col < cols; col++) {
        const into = 4 * ((rows - 1 - row) * cols + col);
        if (before[into + 3] || inside[row * cols + col]) continue;
        const sum = [0, 0, 0, 0];
        let neighbours = 0;
        for (let r = Math.max(0, row - 1); r <= Math.min(rows - 1, row + 1); r++) {
          for (let c = Math.max(0, col - 1); c <= Math.min(cols - 1, col + 1); c++) {
            const from = 4 * ((rows - 1 - r) * cols + c);
            if (!before[from + 3]) continue;
            neighbours += 1;
            for (let i = 0; i < 4; i++) sum[i] = (sum[i] as number) + (before[from + i] as number);
          }
        }
        if (neighbours) for (let i = 0; i < 4; i++) pixels[into + i] = (sum[i] as number) / neighbours;
      }
    }
  }
}
