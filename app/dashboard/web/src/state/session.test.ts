import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { NewMission, StepView } from "../api/types";

let asked: string[] = [];
let answer: (method: string, path: string) => unknown = () => [];

beforeEach(() => {
  asked = [];
  // What signals of the page ask for when they are made, and the page's address.
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => undefined }));
  vi.stubGlobal("location", { hash: "" });
  vi.stubGlobal("fetch", async (address: string, { method = "GET" }: RequestInit = {}) => {
    const path = address.replace("/api/v1", "");
    asked.push(`${method} ${path}`);
    const told = answer(method, path);
    return told instanceof Response ? told : new Response(JSON.stringify(told));
  });
});
afterEach(() => {
  vi.unstubAllGlobals();
});

const step = (number: number, status: string) =>
  ({ number, committed_at: "2026-06-01T10:00:00Z", waypoints: [{ vehicle: "a", status }] }) as StepView;

describe("steps", () => {
  it("are asked for again where they were still to be flown, as they were known by charts of the running mission", async () => {
    const { selectedId, steps } = await import("./store");
    const { fetchSteps } = await import("./session");
    selectedId.value = "m";
    answer = () => [step(1, "reached"), step(2, "planned")];
    await fetchSteps();
    answer = () => [step(2, "reached"), step(3, "planned")];
    await fetchSteps(true);
    expect(asked).toEqual([
      "GET /missions/m/steps?after=0&limit=1000",
      "GET /missions/m/steps?after=1&limit=1000",
    ]);
    expect(steps.value.map(({ waypoints }) => waypoints[0]?.status)).toEqual([
      "reached",
      "reached",
      "planned",
    ]);
  });

  it("that came since the past was looked at are shown, too", async () => {
    const { replayStep, selectedId } = await import("./store");
    const { replay, shownStep } = await import("./past/replay");
    selectedId.value = "n";
    let last = 2;
    answer = (_, path) =>
      path.includes("/steps")
        ? Array.from({ length: last }, (_, i) => step(i + 1, "reached"))
        : { features: [] };
    await replay(1);
    last = 3;
    await replay(3);
    expect(replayStep.value).toBe(3);
    expect(shownStep.value?.number).toBe(3);
  });
});

describe("a slider that is moved", () => {
  it("asks for the past once, and shows the step where it was left", async () => {
    const { replayStep, selectedId } = await import("./store");
    const { awaited, replay } = await import("./past/replay");
    selectedId.value = "o";
    answer = (_, path) =>
      path.includes("/steps") ? [1, 2, 3, 4].map((n) => step(n, "reached")) : { features: [] };
    const moves = [4, 3, 2].map(replay);
    expect(awaited.value).toBe(2);
    expect(replayStep.value).toBe(null);
    await Promise.all(moves);
    expect(replayStep.value).toBe(2);
    expect(awaited.value).toBe(null);
    expect(asked.filter((one) => one.includes("tracks"))).toHaveLength(1);
  });

  it("shows the present where that was asked for meanwhile", async () => {
    const { replayStep, selectedId } = await import("./store");
    const { replay, showPresent } = await import("./past/replay");
    selectedId.value = "p";
    const move = replay(1);
    showPresent();
    await move;
    expect(replayStep.value).toBe(null);
  });
});

it("a mission whose deletion is refused stays in sight", async () => {
  const { selectedId } = await import("./store");
  const { deleteMission } = await import("./session");
  selectedId.value = "q";
  location.hash = "#/missions/q";
  answer = (method) =>
    method === "DELETE" ? new Response(JSON.stringify({ detail: "it runs" }), { status: 409 }) : [];
  await deleteMission("q");
  expect(location.hash).toBe("#/missions/q");
});

it("of missions whose tide table is refused none stays", async () => {
  const { createMissions } = await import("./session");
  const { ServiceError } = await import("../api/client");
  let made = 0;
  answer = (method) => {
    if (method === "POST") made += 1;
    return method === "POST" ? { id: `m${made}` } : [];
  };
  const refuse = (id: string) =>
    id === "m2" ? Promise.reject(new ServiceError("line 1 is no level", 422)) : Promise.resolve();
  const described = [{ name: "one" }, { name: "two" }] as NewMission[];
  await expect(createMissions(described, refuse)).rejects.toThrow("line 1 is no level");
  expect(asked.filter((one) => one.startsWith("DELETE"))).toEqual([
    "DELETE /missions/m1",
    "DELETE /missions/m2",
  ]);
});

describe("a refusal", () => {
  it("stays when a command that was sent before it is answered, and goes with one that was sent after it", async () => {
    const { ServiceError } = await import("../api/client");
    const { refusal, send } = await import("./session");
    let answered: (value: string) => void = () => undefined;
    const slow = send("resume", new Promise<string>((resolve) => (answered = resolve)));
    await send("go", Promise.reject(new ServiceError("outside the area", 422)));
    answered("done");
    await slow;
    expect(refusal.value?.error.message).toBe("outside the area");
    await send("hold", Promise.resolve("done"));
    expect(refusal.value).toBeNull();
  });
});
