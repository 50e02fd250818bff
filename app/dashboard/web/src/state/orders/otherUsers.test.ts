import { afterEach, beforeAll, describe, expect, it, vi } from "vitest";
import type { EventView } from "../../api/types";
import { chosenLanguage } from "../../words/say";

// What signals of the page ask for when they are made.
beforeAll(() => {
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => undefined }));
});
afterEach(() => {
  chosenLanguage.value = "system";
});

const event = (id: number, kind: string, message: string, data: Record<string, unknown>): EventView => ({
  id,
  mission_id: "m",
  time: "2026-01-01T00:00:00Z",
  level: "info",
  kind,
  message,
  data,
});

const EVENTS = [
  event(4, "state", "running by Ana", { state: "running", actor: "Ana" }),
  event(5, "state", "paused by Rui", { state: "paused", actor: "Rui" }),
  event(6, "step", "step 3", {}),
  event(7, "vehicle", "lauv-1 joined", { vehicle: "lauv-1", actor: "Ana" }),
];

describe("what others command", () => {
  it("is the last that somebody else did since the page looks", async () => {
    const { commandOfOthers } = await import("./otherUsers");
    expect(commandOfOthers(EVENTS, 3, "Rui")?.id).toBe(7);
    expect(commandOfOthers(EVENTS, 3, "Ana")?.id).toBe(5);
    expect(commandOfOthers(EVENTS, 5, "Ana")).toBeUndefined();
    expect(commandOfOthers(EVENTS, 7, "Rui")).toBeUndefined();
  });

  it("is told with who did it", async () => {
    const { commandWords } = await import("./otherUsers");
    expect(EVENTS.filter(({ data }) => data.actor).map(commandWords)).toEqual([
      "Ana set the mission running",
      "Rui paused the mission",
      "Ana: lauv-1 joined",
    ]);
    chosenLanguage.value = "pt";
    expect(commandWords(EVENTS[1] as EventView)).toBe("Rui pôs a missão em pausa");
  });
});
