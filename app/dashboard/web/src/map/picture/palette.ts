/** Colour scales for grids. */

import type { LayerView } from "../../api/types";
import { say } from "../../words/say";
import type { Drawn } from "./drawings";

export type Rgb = readonly [number, number, number];

export interface Palette {
  readonly stops: readonly Rgb[];
  /** For style sheets: the same stops as a gradient, low values first. */
  readonly css: string;
}

function palette(hex: string): Palette {
  const colours = hex.split(" ");
  return {
    stops: colours.map((h) => [0, 2, 4].map((i) => Number.parseInt(h.slice(i, i + 2), 16)) as unknown as Rgb),
    css: colours.map((h) => `#${h}`).join(", "),
  };
}

/** cmocean "deep" (Thyng et al. 2016), every eighth entry: perceptually uniform, shallow is light. */
export const DEEP = palette(
  "fdfecc edf7c3 ddf2ba ccecb3 bbe6ac aae0a8 98daa4 87d4a3 78cea3 6bc6a3 62bfa4 5ab7a4 55aea3 51a6a2 4e9ea1 " +
    "4b96a0 488e9e 45869c 437e9a 417698 3f6e97 3e6695 3e5e93 3f5590 404c8b 414481 413d75 3e3767 3b315a 362b4d " +
    "322541 2d1f36 281a2c",
);

/** One hue for uncertainty: the paler, the better known. */
const VIOLET = palette("fbf7fd f1e6f7 e3cef0 d1b1e6 bc90da a56fcb 8c50b8 72369f 582183 3f1064");

const HALINE = palette(
  "fdef9a e3e67e c4dd65 9ed65c 7acb67 61bf74 50b07e 44a284 3c9387 338588 297789 1c6a8c 0f5b90 0f4a98 2034a2 2e1d93 2a186c",
);
const VIRIDIS = palette(
  "fde725 d8e219 addc30 84d44b 5ec962 3fbc73 28ae80 1fa088 21918c 26828e 2c728e 33638d 3b528b 424086 472d7b 48186a 440154",
);
const CIVIDIS = palette(
  "fee838 f0d846 dec958 cdbb63 bcae6c aba072 9b9476 8c8878 7d7c78 6f7073 61656f 535a6d 434e6c 32436d 1a386f 002e6a 00224e",
);
const GREY = palette(
  "fffffd eaeae8 d6d6d4 c3c3c2 b1b1b0 a0a09f 908f8f 807f7f 717070 626161 535352 454444 363636 282727 191818 080808",
);

/** What the operator may choose for depths: each perceptually even, shallow is light. */
export const DEPTH_PALETTES = {
  deep: {
    get title() {
      return say("palette.deep");
    },
    palette: DEEP,
  },
  haline: {
    get title() {
      return say("palette.haline");
    },
    palette: HALINE,
  },
  viridis: {
    get title() {
      return say("palette.viridis");
    },
    palette: VIRIDIS,
  },
  cividis: {
    get title() {
      return say("palette.cividisColourBlindSafe");
    },
    palette: CIVIDIS,
  },
  grey: {
    get title() {
      return say("palette.grey");
    },
    palette: GREY,
  },
} as const;

export type DepthPalette = keyof typeof DEPTH_PALETTES;

/** cmocean "matter", for counts and slopes. */
const MATTER = palette(
  "feedb0 fbd79b f9c187 f6ab76 f29567 ed7f5b e66a54 dc5553 ce4356 be355c ab2960 972163 821c63 6d195e 571756 42144b 2f0f3e",
);

/** cmocean "balance", for differences: zero is pale, shallower than the reference blue, deeper red. */
const BALANCE = palette(
  "181c43 263276 2548b0 0f6abd 3888ba 65a2bc 98bac5 c7d2d7 f1eceb e2c7be d7a290 cc7d63 bf573a ae2e24 8d1029 630e23 3c0912",
);

/** Of layers by classes: missed, too few, enough; as landmarks are drawn. */
const CLASSES = palette("b03a2e f4c450 2e7d6e");

/** The palettes that layers name beside that of depths, and beside those with drawings of their own. */
export const PALETTES: Readonly<Record<Exclude<LayerView["palette"], "deep" | Drawn>, Palette>> = {
  violet: VIOLET,
  matter: MATTER,
  balance: BALANCE,
  classes: CLASSES,
};

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

/** A palette as 256 colours, three bytes each. */
export function lookupTable(palette: Palette): Uint8Array<ArrayBuffer> {
  const table = new Uint8Array(256 * 3);
  for (let i = 0; i < 256; i++) table.set(colourAt(palette, i, 0, 255).map(Math.round), i * 3);
  return table;
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
