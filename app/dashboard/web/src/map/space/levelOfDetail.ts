/** How much is drawn of something that takes long while it is turned: as much as this machine keeps up with. Pure. */

/** A picture that holds the next one up for longer makes turning jerky. */
const SLOW_MS = 80;
/** After some in a row that come as quickly as this, more is drawn. */
const [QUICK_MS, IN_A_ROW] = [35, 8];
const LEAST = 1 / 32;

export class Pace {
  #detail = 1;
  #quick = 0;

  /** The share that is drawn while it is turned, 0 to 1. */
  get detail(): number {
    return this.#detail;
  }

  /** It begins to be turned: perhaps the machine has more time than before. */
  begin(): void {
    this.#detail = Math.min(1, 2 * this.#detail);
    this.#quick = 0;
  }

  /** A picture was drawn, and the next one could be after so long. */
  drawn(took_ms: number): void {
    this.#quick = took_ms < QUICK_MS ? this.#quick + 1 : 0;
    if (took_ms > SLOW_MS) this.#detail = Math.max(LEAST, this.#detail / 2);
    else if (this.#quick >= IN_A_ROW) this.begin();
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
