/** From places to pixels of a window on the map, north up, as MapLibre does it (Web Mercator, tiles of 512 pixels). Pure. */

import type { LngLat } from "../../api/types";

const TILE_PX = 512;

export const mercatorX = (lng: number) => (180 + lng) / 360;
export const mercatorY = (lat: number) =>
  (180 - (180 / Math.PI) * Math.log(Math.tan(Math.PI / 4 + (lat * Math.PI) / 360))) / 360;

export interface Camera {
  centre: LngLat;
  zoom: number;
}

export class Projection {
  readonly #left: number;
  readonly #top: number;
  readonly #world: number;

  /** The camera's centre lies in the middle of a window of this size. */
  constructor(
    readonly camera: Camera,
    readonly width: number,
    readonly height: number,
  ) {
    this.#world = TILE_PX * 2 ** camera.zoom;
    this.#left = mercatorX(camera.centre[0]) * this.#world - width / 2;
    this.#top = mercatorY(camera.centre[1]) * this.#world - height / 2;
  }

  x(lng: number): number {
    return mercatorX(lng) * this.#world - this.#left;
  }

  y(lat: number): number {
    return mercatorY(lat) * this.#world - this.#top;
  }

  place(x: number, y: number): LngLat {
    const lng = ((x + this.#left) / this.#world) * 360 - 180;
    const lat =
      (360 / Math.PI) * Math.atan(Math.exp(Math.PI - 2 * Math.PI * ((y + this.#top) / this.#world))) - 90;
    return [lng, lat];
  }
}

/** How a picture that was drawn for one camera has to be moved and scaled about its middle to fit another's window. */
export function moved(drawn: Projection, now: Projection): { x: number; y: number; scale: number } {
  const [lng, lat] = drawn.camera.centre;
  return {
    x: now.x(lng) - drawn.width / 2,
    y: now.y(lat) - drawn.height / 2,
    scale: 2 ** (now.camera.zoom - drawn.camera.zoom),
  };
}
