import { afterEach, beforeEach, expect, it, vi } from "vitest";
import type { MissionView } from "../api/types";

// What signals of the page ask for when they are made.
beforeEach(() => {
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => undefined }));
});
afterEach(() => {
  vi.unstubAllGlobals();
});

it("what is shown is live while the service tells of it, not as long as its socket stays open", async () => {
  const { live, now, socketStatus, view } = await import("./store");
  view.value = { ...view.value, vehiclesAt: 10_000 };
  now.value = 10_400;
  expect(live.value).toBe(false);
  socketStatus.value = { kind: "open" };
  expect(live.value).toBe(true);
  now.value = 16_000;
  expect(live.value).toBe(false);
  view.value = { ...view.value, vehiclesAt: 16_100 };
  expect(live.value).toBe(true);
  socketStatus.value = { kind: "connecting" };
  expect(live.value).toBe(false);
});

it("lists are of now while the service answers, and not while it is silent about the mission that is shown", async () => {
  const { listedAt, listsLive, now, serviceFault, socketStatus, view } = await import("./store");
  const { ServiceError } = await import("../api/client");
  const { EMPTY_VIEW } = await import("./live");
  view.value = EMPTY_VIEW;
  listedAt.value = 100_000;
  now.value = 106_000;
  expect(listsLive.value).toBe(true);
  view.value = { ...EMPTY_VIEW, mission: {} as MissionView, vehiclesAt: 100_500 };
  expect(listsLive.value).toBe(false);
  socketStatus.value = { kind: "waiting", attempt: 1, retryAt: 0, why: "missing" };
  expect(listsLive.value).toBe(true);
  socketStatus.value = null;
  view.value = { ...view.value, vehiclesAt: 105_900 };
  expect(listsLive.value).toBe(true);
  serviceFault.value = new ServiceError("gone", 0);
  expect(listsLive.value).toBe(false);
  serviceFault.value = null;
  now.value = 120_000;
  view.value = EMPTY_VIEW;
  expect(listsLive.value).toBe(false);
});

it("the depth that is typed in a mission's checklist is that mission's alone, and begins as it was described", async () => {
  const { describedDepths, floorDepth, selectedId } = await import("./store");
  describedDepths.set("c", "7");
  selectedId.value = "a";
  floorDepth.value = "12.5";
  selectedId.value = "b";
  expect(floorDepth.value).toBe("");
  selectedId.value = "c";
  expect(floorDepth.value).toBe("7");
});
