/**
 * Two sheets that lie over the map's own canvas and are drawn on by the page. The still one holds what seldom changes;
 * it reaches beyond the window and is only shifted while the map moves. The lively one is drawn anew for every picture.
 * So a vehicle that moves costs a few short lines, with and without a graphics card.
 */

import type { Map as MapLibreMap } from "maplibre-gl";
import { say } from "../../words/say";
import { moved, Projection } from "./projection";

/** How far the still sheet reaches beyond the window, as a share of its size on every side. */
const MARGIN = 0.25;
/** A sheet that is scaled by more than this looks coarse: it is drawn anew at once. */
const MOST_SCALE = 1.6;
const SETTLED_MS = 90;
const MOST_RATIO = 2;

export type Paint = (context: CanvasRenderingContext2D, at: Projection) => void;

export class Sheets {
  readonly #still: CanvasRenderingContext2D;
  readonly #lively: CanvasRenderingContext2D;
  #drawn: Projection | null = null;
  #stillWanted = true;
  #frame = 0;
  #settle = 0;

  constructor(
    readonly map: MapLibreMap,
    readonly paintStill: Paint,
    readonly paintLively: Paint,
  ) {
    const under = map.getCanvas();
    this.#lively = sheet("lively");
    this.#still = sheet("still");
    under.after(this.#still.canvas, this.#lively.canvas);
    map.on("move", this.#follow);
    map.on("resize", this.redraw);
    map.on("remove", () => {
      cancelAnimationFrame(this.#frame);
      clearTimeout(this.#settle);
    });
    this.redraw();
  }

  /** The window as it is now. */
  get projection(): Projection {
    const { lng, lat } = this.map.getCenter();
    const { clientWidth, clientHeight } = this.map.getContainer();
    return new Projection({ centre: [lng, lat], zoom: this.map.getZoom() }, clientWidth, clientHeight);
  }

  /** Draws everything at the next picture. */
  redraw = (): void => {
    this.#stillWanted = true;
    this.refresh();
  };

  /** Draws what moves at the next picture. */
  refresh = (): void => {
    if (this.#frame) return;
    this.#frame = requestAnimationFrame(() => {
      this.#frame = 0;
      this.#draw();
    });
  };

  #follow = (): void => {
    const now = this.projection;
    if (this.#drawn) {
      const { x, y, scale } = moved(this.#drawn, now);
      const [w, h] = [(this.#drawn.width * scale) / 2, (this.#drawn.height * scale) / 2];
      const [middleX, middleY] = [x + this.#drawn.width / 2, y + this.#drawn.height / 2];
      const covers =
        middleX - w <= 0 && middleY - h <= 0 && middleX + w >= now.width && middleY + h >= now.height;
      if (scale > MOST_SCALE || (!covers && scale === 1)) this.#stillWanted = true;
      else if (scale !== 1) {
        // A zoom goes on for a while: what it comes to is drawn once it has settled.
        clearTimeout(this.#settle);
        this.#settle = window.setTimeout(this.redraw, SETTLED_MS);
      }
    }
    cancelAnimationFrame(this.#frame);
    this.#frame = 0;
    this.#draw();
  };

  #draw(): void {
    const now = this.projection;
    if (now.width === 0 || now.height === 0) return;
    if (this.#stillWanted || !this.#drawn) {
      this.#stillWanted = false;
      clearTimeout(this.#settle);
      const grow = 1 + 2 * MARGIN;
      this.#drawn = new Projection(now.camera, Math.round(now.width * grow), Math.round(now.height * grow));
      paint(this.#still, this.#drawn, this.paintStill);
    }
    const { x, y, scale } = moved(this.#drawn, now);
    this.#still.canvas.style.transform = `translate(${x}px, ${y}px) scale(${scale})`;
    paint(this.#lively, now, this.paintLively);
  }
}

function sheet(name: string): CanvasRenderingContext2D {
  const canvas = document.createElement("canvas");
  canvas.className = `sheet ${name}`;
  const context = canvas.getContext("2d");
  if (!context) throw new Error(say("paper.thisBrowserCannotDrawOnA"));
  return context;
}

function paint(context: CanvasRenderingContext2D, at: Projection, how: Paint): void {
  const ratio = Math.min(devicePixelRatio, MOST_RATIO);
  const { canvas } = context;
  const [width, height] = [Math.round(at.width * ratio), Math.round(at.height * ratio)];
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
    canvas.style.width = `${at.width}px`;
    canvas.style.height = `${at.height}px`;
  }
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, at.width, at.height);
  how(context, at);
}
