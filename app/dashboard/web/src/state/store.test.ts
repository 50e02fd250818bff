import { afterEach, beforeEach, expect, it, vi } from "vitest";

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
