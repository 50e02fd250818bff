/** Turns a layer into a picture, with stripes where cells were filled in between soundings. Pure; runs in a worker. */

import { LANDMARK_COLOURS, landmarkState } from "./landmarks";
import { UNKNOWN } from "./seafloor";

export interface Painting {
  rows: number;
  cols: number;
  /** Whole numbers, row 0 south. */
  values: Int32Array;
  flags: Int32Array;
  /** Of the first and the last colour, in the layer's whole numbers. */
  low: number;
  high: number;
  /** 256 colours, three bytes each; null: the values are flags whose landmark states are shown. */
  table: Uint8Array | null;
  hatched: boolean;
}

export interface Picture {
  width: number;
  height: number;
  pixels: Uint8ClampedArray<ArrayBuffer>;
}

const WIDEST = 1024;
const STRIPE_PX = 9;

/** Pixels per cell's side: several where that keeps the picture small, so that stripes can be finer than cells. */
export function magnification(rows: number, cols: number): number {
  return Math.max(1, Math.min(12, Math.floor(WIDEST / Math.max(rows, cols))));
}

/** The picture, northern row first; cells without a value are transparent. */
export function paint({ rows, cols, values, flags, low, high, table, hatched }: Painting): Picture {
  const size = hatched ? magnification(rows, cols) : 1;
  const width = cols * size;
  const height = rows * size;
  const words = new Uint32Array(width * height);
  const scale = 255 / Math.max(1e-9, high - low);
  const little = colours(table);
  for (let row = 0; row < rows; row++) {
    const top = (rows - 1 - row) * size;
    for (let col = 0; col < cols; col++) {
      const value = values[row * cols + col] as number;
      if (value === UNKNOWN) continue;
      const index = table
        ? Math.round(Math.min(255, Math.max(0, (value - low) * scale)))
        : landmarkState(value);
      const colour = little[index] as number;
      const measured = ((flags[row * cols + col] as number) & 3) !== 0;
      for (let y = 0; y < size; y++) {
        const line = (top + y) * width + col * size;
        for (let x = 0; x < size; x++) words[line + x] = colour;
      }
      if (!hatched || measured) continue;
      for (let y = 0; y < size; y++) {
        const line = (top + y) * width + col * size;
        for (let x = 0; x < size; x++) {
          const at = (col * size + x + top + y) % STRIPE_PX;
          if (at === 0) words[line + x] = blended(colour, 0, 0.32);
          else if (at === 1) words[line + x] = blended(colour, 255, 0.32);
        }
      }
    }
  }
  return { width, height, pixels: new Uint8ClampedArray(words.buffer) };
}

/** Colours as the bytes of a pixel lie in a little-endian word. */
function colours(table: Uint8Array | null): Uint32Array {
  if (!table) return Uint32Array.from(LANDMARK_COLOURS, ([r, g, b]) => word(r, g, b));
  return Uint32Array.from({ length: 256 }, (_, i) =>
    word(table[i * 3] as number, table[i * 3 + 1] as number, table[i * 3 + 2] as number),
  );
}

const word = (r: number, g: number, b: number) => ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0;

function blended(colour: number, with_: number, share: number): number {
  const mix = (shift: number) => Math.round(((colour >> shift) & 255) * (1 - share) + with_ * share);
  return word(mix(0), mix(8), mix(16));
}
