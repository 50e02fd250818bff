/** How much is drawn of something that takes long while it is turned: as much as this machine keeps up with. Pure. */

/** A picture that comes later than this after the one before makes turning jerky. */
const SLOW_MS = 80;
/** Who waits this long does not turn it. */
const PAUSE_MS = 1000;
const LEAST = 1 / 64;

export class Pace {
  #detail = 1;
  #last_ms: number | null = null;

  /** The share that is drawn while it is turned, 0 to 1. */
  get detail(): number {
    return this.#detail;
  }

  /** It begins to be turned: perhaps the machine has more time than before. */
  begin(): void {
    this.#detail = Math.min(1, 2 * this.#detail);
    this.#last_ms = null;
  }

  /** A picture was drawn. */
  drawn(at_ms: number): void {
    const gap_ms = at_ms - (this.#last_ms ?? at_ms);
    this.#last_ms = at_ms;
    if (gap_ms > SLOW_MS && gap_ms < PAUSE_MS) this.#detail = Math.max(LEAST, this.#detail / 2);
  }
}

/** The numbers below `count` in an order that is as good as random and always the same. */
export function shuffled(count: number): Uint32Array {
  const order = Uint32Array.from({ length: count }, (_, i) => i);
  let state = 1;
  for (let i = count - 1; i > 0; i--) {
    // Lehmer's generator with the multiplier of Park and Miller (1988).
    state = (state * 48_271) % 2_147_483_647;
    const k = state % (i + 1);
    const other = order[k] as number;
    order[k] = order[i] as number;
    order[i] = other;
  }
  return order;
}
