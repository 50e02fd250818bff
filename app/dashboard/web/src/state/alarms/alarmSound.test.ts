import { afterEach, beforeEach, expect, it, vi } from "vitest";
import type { AlarmView } from "../../api/types";

beforeEach(() => {
  vi.useFakeTimers();
  // What signals of the page ask for when they are made.
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => undefined }));
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

/** Counts tones. */
function audioOf(started: () => void): AudioContext {
  const level = { gain: { setValueAtTime: () => undefined, exponentialRampToValueAtTime: () => undefined } };
  return {
    state: "running",
    currentTime: 0,
    destination: {},
    createGain: () => ({ ...level, connect: () => undefined }),
    createOscillator: () => ({
      frequency: {},
      connect: (to: unknown) => to,
      start: started,
      stop: () => undefined,
    }),
  } as unknown as AudioContext;
}

it("an open alarm sounds every four seconds, however often the live view tells of it, until it is over", async () => {
  const { view } = await import("../store");
  const { followAlarms } = await import("./alarmSound");
  const alarm = { id: "1", severity: "critical", ended_at: null } as AlarmView;
  let tones = 0;
  const stop = followAlarms(() =>
    audioOf(() => {
      tones += 1;
    }),
  );
  for (let tenth = 0; tenth < 100; tenth++) {
    view.value = { ...view.value, alarms: [alarm], vehiclesAt: tenth };
    vi.advanceTimersByTime(100);
  }
  expect(tones).toBe(2 * 3);
  view.value = { ...view.value, alarms: [{ ...alarm, ended_at: "2026-01-01T00:00:00Z" }] };
  vi.advanceTimersByTime(60_000);
  expect(tones).toBe(2 * 3);
  stop();
});
