/** Paints layers and finds contours beside the page, so that it never stands still. */

import { type Contour, contours } from "./contours";
import { type Painting, paint } from "./paint";

export interface PictureTask {
  id: number;
  painting: Painting;
  /** Depths and the distance between contours in whole numbers; null: no contours are wanted. */
  contours: { depths: Int32Array; interval: number } | null;
}

export interface PictureResult {
  id: number;
  width: number;
  height: number;
  pixels: Uint8ClampedArray<ArrayBuffer>;
  contours: Contour[];
}

self.onmessage = ({ data }: MessageEvent<PictureTask>) => {
  const { rows, cols } = data.painting;
  const picture = paint(data.painting);
  const lines = data.contours ? contours(data.contours.depths, rows, cols, data.contours.interval) : [];
  const result: PictureResult = { id: data.id, ...picture, contours: lines };
  self.postMessage(result, { transfer: [picture.pixels.buffer] });
};
