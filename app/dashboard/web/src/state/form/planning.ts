/** Asking for the plan of what is being described, again and again while that changes. Pure apart from its clock. */

/** After so long without a change it is asked for; typing is quicker than that. */
const SETTLE_MS = 150;
/** While something is dragged it is asked for at least as often. */
const LONGEST_WAIT_MS = 450;
/** What is asked for is let finish for so long although something newer is wanted: else a drag would show nothing. */
const PATIENCE_MS = 700;

type Ask<T> = (of: string, gone: AbortSignal, tell: (part: T) => void) => Promise<T>;

/**
 * Asks for the plans of several missions, one after the other, each as it follows from the plan before, and tells after
 * each which there are; what did not change since is not asked for again.
 */
export function plansOf<Mission, Plan>(
  ask: (mission: Mission, gone: AbortSignal) => Promise<Plan>,
  following: (before: Plan | undefined, mission: Mission) => Mission,
): Ask<Plan[]> {
  let known = new Map<string, Plan>();
  return async (of, gone, tell) => {
    const found = new Map<string, Plan>();
    for (const one of JSON.parse(of) as Mission[]) {
      const mission = following([...found.values()].at(-1), one);
      const key = JSON.stringify(mission);
      const plan: Plan = known.get(key) ?? (await ask(mission, gone));
      known.set(key, plan);
      found.set(key, plan);
      tell([...found.values()]);
    }
    known = found;
    return [...found.values()];
  };
}

export type Answer<T> = { found: T; of: string } | { error: unknown; of: string };

/** Asks for one thing at a time, always for what was wanted last; gives up what takes long and is out of date. */
export class LatestAsker<T> {
  #wanted: string | null = null;
  /** Since when what is wanted has not been asked for. */
  #since = 0;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #underWay: { of: string; gone: AbortController; begun: number } | null = null;

  constructor(
    readonly ask: Ask<T>,
    readonly show: (answer: Answer<T>, current: boolean) => void,
  ) {}

  /** Wants the plan of something; null: of nothing any more. */
  want(of: string | null): void {
    if (of === this.#wanted) return;
    const now = Date.now();
    if (this.#timer === undefined) this.#since = now;
    this.#wanted = of;
    clearTimeout(this.#timer);
    this.#timer = undefined;
    if (of === null) {
      this.#underWay?.gone.abort();
      this.#underWay = null;
      return;
    }
    if (this.#underWay && now - this.#underWay.begun > PATIENCE_MS) {
      this.#underWay.gone.abort();
      this.#underWay = null;
    }
    const wait = Math.min(SETTLE_MS, Math.max(this.#since + LONGEST_WAIT_MS - now, 0));
    this.#timer = setTimeout(() => {
      this.#timer = undefined;
      this.#begin();
    }, wait);
  }

  #begin(): void {
    const of = this.#wanted;
    // Whoever ends begins with what is wanted then.
    if (of === null || this.#underWay) return;
    const mine = { of, gone: new AbortController(), begun: Date.now() };
    this.#underWay = mine;
    const end = (answer: Answer<T>) => {
      if (this.#underWay !== mine) return;
      this.#underWay = null;
      this.show(answer, of === this.#wanted);
      if (of !== this.#wanted && this.#timer === undefined) this.#begin();
    };
    const tell = (part: T) => {
      if (this.#underWay === mine) this.show({ found: part, of }, of === this.#wanted);
    };
    this.ask(of, mine.gone.signal, tell).then(
      (found) => end({ found, of }),
      (error: unknown) => end({ error, of }),
    );
  }
}
