/** The page's side of the painting worker: always the newest task, never more than one under way. */

import type { PictureResult, PictureTask } from "./picture.worker";

export type Work = Omit<PictureTask, "id">;

export class Painter {
  readonly #worker = new Worker(new URL("./picture.worker.ts", import.meta.url), { type: "module" });
  #next: Work | null = null;
  #busy = false;
  #number = 0;

  constructor(onPicture: (result: PictureResult) => void) {
    this.#worker.onmessage = ({ data }: MessageEvent<PictureResult>) => {
      this.#busy = false;
      if (data.id === this.#number) onPicture(data);
      this.#begin();
    };
  }

  /** Paints this next; a task that was not begun yet is forgotten. */
  paint(work: Work): void {
    this.#next = work;
    this.#begin();
  }

  /** Whatever is being painted is not wanted any more. */
  forget(): void {
    this.#next = null;
    this.#number += 1;
  }

  close(): void {
    this.#worker.terminate();
  }

  #begin(): void {
    if (this.#busy || !this.#next) return;
    this.#busy = true;
    this.#number += 1;
    const work = this.#next;
    this.#next = null;
    this.#worker.postMessage({ id: this.#number, ...work } satisfies PictureTask);
  }
}
