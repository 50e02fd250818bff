import type { LiveMessage } from "./types";

export type SocketStatus =
  | { kind: "connecting" }
  /** What is there now was told; what changes will be. */
  | { kind: "open" }
  /** `why`: what the service said of it; null where the service is gone. */
  | { kind: "waiting"; attempt: number; retryAt: number; why: "missing" | "crowded" | null }
  /** The service does not let this viewer in; asking again would change nothing. */
  | { kind: "refused"; reason: string };

const UNAUTHENTICATED = 4401;
const FORBIDDEN = 4403;
const SAID: Readonly<Record<number, "missing" | "crowded">> = { 4404: "missing", 4429: "crowded" };

export interface SocketHooks {
  onMessage: (message: LiveMessage) => void;
  onStatus: (status: SocketStatus) => void;
}

const FIRST_DELAY_MS = 500;
const LONGEST_DELAY_MS = 10_000;

/** How long to wait before try number `attempt` (from 1): doubling, with a random part so that pages do not all come at once. */
export function backoffMs(attempt: number, random = Math.random()): number {
  const full = Math.min(LONGEST_DELAY_MS, FIRST_DELAY_MS * 2 ** (attempt - 1));
  return full * (0.5 + 0.5 * random);
}

/** A live socket that connects again by itself until it is closed, also when it falls silent without closing. */
export class LiveSocket {
  #socket: WebSocket | null = null;
  #retry: ReturnType<typeof setTimeout> | undefined;
  #watch: ReturnType<typeof setTimeout> | undefined;
  #attempt = 0;
  #closed = false;

  constructor(
    readonly url: string,
    readonly hooks: SocketHooks,
    /** After this long without any message the connection counts as dead. */
    readonly silenceMs = 30_000,
  ) {
    this.#connect();
    window.addEventListener("online", this.#hurry);
  }

  close(): void {
    this.#closed = true;
    window.removeEventListener("online", this.#hurry);
    clearTimeout(this.#retry);
    this.#drop();
  }

  #hurry = (): void => {
    if (this.#socket === null && !this.#closed) {
      clearTimeout(this.#retry);
      this.#connect();
    }
  };

  #connect(): void {
    this.hooks.onStatus({ kind: "connecting" });
    const socket = new WebSocket(this.url);
    let told = false;
    this.#socket = socket;
    this.#restartWatch();
    socket.onmessage = (raw: MessageEvent<string>) => {
      if (this.#socket !== socket) return;
      if (this.#attempt > 0) this.#attempt = 0;
      this.#restartWatch();
      this.hooks.onMessage(JSON.parse(raw.data) as LiveMessage);
      if (!told) this.hooks.onStatus({ kind: "open" });
      told = true;
    };
    socket.onclose = ({ code, reason }: CloseEvent) => {
      if (this.#socket !== socket) return;
      if (code === UNAUTHENTICATED || code === FORBIDDEN) this.#refused(reason);
      else this.#lost(code);
    };
  }

  #restartWatch(): void {
    clearTimeout(this.#watch);
    this.#watch = setTimeout(() => this.#lost(), this.silenceMs);
  }

  #lost(code = 0): void {
    this.#drop();
    if (this.#closed) return;
    this.#attempt += 1;
    const delay = backoffMs(this.#attempt);
    const why = SAID[code] ?? null;
    this.hooks.onStatus({ kind: "waiting", attempt: this.#attempt, retryAt: Date.now() + delay, why });
    this.#retry = setTimeout(() => this.#connect(), delay);
  }

  #refused(reason: string): void {
    this.close();
    this.hooks.onStatus({ kind: "refused", reason });
  }

  #drop(): void {
    clearTimeout(this.#watch);
    const socket = this.#socket;
    this.#socket = null;
    socket?.close();
  }
}
