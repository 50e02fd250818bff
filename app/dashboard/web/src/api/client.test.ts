import { afterEach, beforeEach, expect, it, vi } from "vitest";
import { api, ServiceError } from "./client";

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

const fault = (answer: Promise<unknown>) => answer.catch((error: unknown) => error as ServiceError);

it("an order that a service does not answer is given up, and may have been carried out", async () => {
  let gone: AbortSignal | null | undefined;
  vi.stubGlobal("fetch", (_: string, init: RequestInit) => {
    gone = init.signal;
    return new Promise(() => undefined);
  });
  const found = fault(api.act("m", "abort"));
  await vi.advanceTimersByTimeAsync(19_000);
  expect(gone?.aborted).toBe(false);
  await vi.advanceTimersByTimeAsync(1000);
  expect(gone?.aborted).toBe(true);
  expect(await found).toBeInstanceOf(ServiceError);
  expect(await found).toMatchObject({ message: "The service has not answered for 20 s", status: 0 });
  expect(((await found) as ServiceError).remedy).toContain("may or may not have been carried out");
});

it("an order whose connection broke may have been carried out, too; what was only asked for was not", async () => {
  vi.stubGlobal("fetch", () => Promise.reject(new TypeError("network")));
  expect(await fault(api.holdVehicle("m", "a"))).toMatchObject({
    message: "The service does not answer",
    remedy: expect.stringContaining("may or may not"),
  });
  expect(((await fault(api.missions())) as ServiceError).remedy).not.toContain("may or may not");
});

it("lists are asked for again where no answer comes, and what takes long to compute is waited for", async () => {
  vi.stubGlobal("fetch", () => new Promise(() => undefined));
  const list = fault(api.missions());
  let computed = false;
  void api.quality("m").finally(() => {
    computed = true;
  });
  await vi.advanceTimersByTimeAsync(600_000);
  expect(await list).toMatchObject({ status: 0 });
  expect(computed).toBe(false);
});

it("what a service refuses in time is told as it says it", async () => {
  vi.stubGlobal("fetch", async () => new Response(JSON.stringify({ detail: "it is over" }), { status: 409 }));
  expect(await fault(api.act("m", "pause"))).toMatchObject({
    message: "it is over",
    status: 409,
    remedy: "",
  });
});
