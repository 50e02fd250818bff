/** Colour scales for grids. */

export type Rgb = readonly [number, number, number];

export interface Palette {
  readonly stops: readonly Rgb[];
  /** For style sheets: the same stops as a gradient, low values first. */
  readonly css: string;
}

function palette(hex: readonly string[]): Palette {
  return {
    stops: hex.map((h) => [0, 2, 4].map((i) => Number.parseInt(h.slice(i, i + 2), 16)) as unknown as Rgb),
    css: hex.map((h) => `#${h}`).join(", "),
  };
}

/** cmocean "deep" (Thyng et al. 2016), every eighth entry: perceptually uniform, shallow is light. */
export const DEEP = palette(
  (
    "fdfecc edf7c3 ddf2ba ccecb3 bbe6ac aae0a8 98daa4 87d4a3 78cea3 6bc6a3 62bfa4 5ab7a4 55aea3 51a6a2 4e9ea1 " +
    "4b96a0 488e9e 45869c 437e9a 417698 3f6e97 3e6695 3e5e93 3f5590 404c8b 414481 413d75 3e3767 3b315a 362b4d " +
    "322541 2d1f36 281a2c"
  ).split(" "),
);

/** One hue for uncertainty: the paler, the better known. */
export const VIOLET = palette(
  "fbf7fd f1e6f7 e3cef0 d1b1e6 bc90da a56fcb 8c50b8 72369f 582183 3f1064".split(" "),
);

/** The colour of a value between `low` and `high`; values outside take the end's colour. */
export function colourAt({ stops }: Palette, value: number, low: number, high: number): Rgb {
  const last = stops.length - 1;
  const span = high - low;
  const at = span > 0 ? Math.min(1, Math.max(0, (value - low) / span)) * last : 0;
  const i = Math.min(last - 1, Math.floor(at));
  const part = at - i;
  const a = stops[i] as Rgb;
  const b = stops[i + 1] as Rgb;
  return [a[0] + (b[0] - a[0]) * part, a[1] + (b[1] - a[1]) * part, a[2] + (b[2] - a[2]) * part];
}

/** Okabe and Ito's set in an order that stands out on the depth palette; distinct for colour-blind eyes. */
const VEHICLE_COLOURS = [
  "#e69f00",
  "#cc79a7",
  "#56b4e9",
  "#f0e442",
  "#d55e00",
  "#0072b2",
  "#009e73",
] as const;

export function vehicleColour(index: number): string {
  return VEHICLE_COLOURS[index % VEHICLE_COLOURS.length] as string;
}

/** The smallest pleasant range (1, 2 or 5 times a power of ten apart) that holds the values. */
export function roundRange(low: number, high: number): [number, number] {
  const step = niceStep((high - low) / 5 || 0.1);
  return [tidy(Math.floor(low / step + 1e-9) * step), tidy(Math.ceil(high / step - 1e-9) * step)];
}

/** The smallest of 1, 2, 5 times a power of ten that is not below the given size. */
export function niceStep(least: number): number {
  const power = 10 ** Math.floor(Math.log10(least));
  const factor = [1, 2, 5, 10].find((f) => f * power >= least * (1 - 1e-9)) ?? 10;
  return tidy(factor * power);
}

function tidy(value: number): number {
  return Number(value.toPrecision(12));
}
