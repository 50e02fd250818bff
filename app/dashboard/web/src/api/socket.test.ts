import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { backoffMs, LiveSocket, type SocketStatus } from "./socket";
import type { LiveMessage } from "./types";

/** Stands for the browser's socket, which vitest's Node does not connect anywhere; the flow tests use the real one. */
class Line {
  static opened: Line[] = [];
  onclose: ((event: { code: number; reason: string }) => void) | null = null;
  onmessage: ((raw: { data: string }) => void) | null = null;
  closed = false;

  constructor(readonly url: string) {
    Line.opened.push(this);
  }

  close(): void {
    this.closed = true;
  }
}

const newest = () => Line.opened.at(-1) as Line;
const TOLD = { data: '{"type":"vehicles","time":"","vehicles":[]}' };

describe("the live socket", () => {
  let statuses: SocketStatus["kind"][];
  let waited: (string | null)[];
  let messages: LiveMessage[];
  let socket: LiveSocket;

  beforeEach(() => {
    vi.useFakeTimers();
    Line.opened = [];
    statuses = [];
    waited = [];
    messages = [];
    vi.stubGlobal("WebSocket", Line);
    vi.stubGlobal("window", new EventTarget());
    socket = new LiveSocket(
      "ws://service/live",
      {
        onStatus: (s) => {
          statuses.push(s.kind);
          if (s.kind === "waiting") waited.push(s.why);
        },
        onMessage: (m) => messages.push(m),
      },
      5000,
    );
  });

  afterEach(() => {
    socket.close();
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it("is open once it has told what is there", () => {
    expect(statuses).toEqual(["connecting"]);
    newest().onmessage?.(TOLD);
    newest().onmessage?.(TOLD);
    expect(statuses).toEqual(["connecting", "open"]);
    expect(messages).toHaveLength(2);
  });

  it("does not ask again where it is not let in", () => {
    newest().onclose?.({ code: 4401, reason: "the session has ended" });
    vi.advanceTimersByTime(60_000);
    expect(Line.opened).toHaveLength(1);
    expect(statuses).toEqual(["connecting", "refused"]);
  });

  it("connects again after the connection closed", () => {
    newest().onmessage?.(TOLD);
    newest().onclose?.({ code: 1006, reason: "" });
    vi.advanceTimersByTime(600);
    expect(Line.opened).toHaveLength(2);
    expect(statuses).toEqual(["connecting", "open", "waiting", "connecting"]);
  });

  it.each([
    [4404, "missing"],
    [4429, "crowded"],
    [1006, null],
  ])("tells why it was closed by %i, and tries again", (code, why) => {
    newest().onclose?.({ code, reason: "" });
    expect(waited).toEqual([why]);
    vi.advanceTimersByTime(600);
    expect(Line.opened).toHaveLength(2);
  });

  it("drops a connection that fell silent", () => {
    vi.advanceTimersByTime(4000);
    newest().onmessage?.(TOLD);
    vi.advanceTimersByTime(4000);
    expect(newest().closed).toBe(false);
    vi.advanceTimersByTime(1500);
    expect(Line.opened[0]?.closed).toBe(true);
    expect(messages).toHaveLength(1);
  });

  it("does not wait when the network comes back", () => {
    newest().onclose?.({ code: 1006, reason: "" });
    window.dispatchEvent(new Event("online"));
    expect(Line.opened).toHaveLength(2);
  });

  it("ignores what an abandoned connection still says", () => {
    const old = newest();
    old.onclose?.({ code: 1006, reason: "" });
    vi.advanceTimersByTime(600);
    old.onmessage?.(TOLD);
    old.onclose?.({ code: 1006, reason: "" });
    expect(messages).toHaveLength(0);
    expect(Line.opened).toHaveLength(2);
  });

  it("stays closed once closed", () => {
    socket.close();
    newest().onclose?.({ code: 1006, reason: "" });
    vi.advanceTimersByTime(60_000);
    expect(Line.opened).toHaveLength(1);
  });
});

describe("the time between tries", () => {
  it("doubles up to ten seconds", () => {
    expect([1, 2, 3, 4].map((n) => backoffMs(n, 1))).toEqual([500, 1000, 2000, 4000]);
    expect(backoffMs(30, 1)).toBe(10_000);
  });

  it("is spread at random over its second half", () => {
    expect(backoffMs(3, 0)).toBe(1000);
    expect(backoffMs(3, 0.5)).toBe(1500);
  });
});
