/** Paints layers and finds contours beside the page, so that it never stands still. */

import { type Contour, contours } from "./contours";
import { FAINT, type Painting, type Picture, paint, strengths } from "./paint";
import { UNKNOWN } from "./seafloor";

export interface PictureTask {
  id: number;
  painting: Painting;
  /** The distance between contours in the depths' whole numbers; null: no contours are wanted. */
  interval: number | null;
}

export interface PictureResult extends Picture {
  id: number;
  contours: Contour[];
}

self.onmessage = ({ data: { id, painting, interval } }: MessageEvent<PictureTask>) => {
  const { rows, cols, depths } = painting;
  const strong = strengths(painting);
  const picture = paint(painting, strong);
  // What is too unsure has no contours.
  const drawn = depths.map((depth, at) => ((strong[at] as number) < FAINT ? UNKNOWN : depth));
  const lines = interval === null ? [] : contours(drawn, rows, cols, interval);
  const result: PictureResult = { id, ...picture, contours: lines };
  const sent = [picture.pixels.buffer, ...(picture.guessed ? [picture.guessed.buffer] : [])];
  self.postMessage(result, { transfer: sent });
};
