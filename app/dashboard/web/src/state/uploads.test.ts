import { afterEach, beforeEach, expect, it, vi } from "vitest";
import { api, type Sending, ServiceError } from "../api/client";
import type { LogView } from "../api/types";
import {
  dismiss,
  isNameless,
  queuedOf,
  sendFile,
  sendLogs,
  underWay,
  uploads,
  uploadsOf,
  wouldBeLost,
} from "./uploads";

// What signals of the page ask for when they are made, before anything is imported.
vi.hoisted(() => {
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => undefined }));
  vi.stubGlobal("location", { hash: "" });
});

const file = (name: string) => new File(["12345"], name);
const log = (id: string, state: LogView["state"]) => ({ id, state }) as LogView;

beforeEach(() => {
  vi.useFakeTimers();
  uploads.value = [];
});
afterEach(() => {
  vi.useRealTimers();
  vi.restoreAllMocks();
});

it("a file on its way shows how much of it has gone, and goes when it is answered", async () => {
  let answer = (_: string) => {};
  const sent = sendFile("m", "log", file("Data.lsf"), ({ onBytes }: Sending) => {
    onBytes(3);
    return new Promise<string>((resolve) => {
      answer = resolve;
    });
  });
  expect(uploadsOf("m", "log")).toMatchObject([{ name: "Data.lsf", size: 5, sent: 3, fault: "" }]);
  expect(uploadsOf("m", "import")).toEqual([]);
  expect(uploadsOf("other", "log")).toEqual([]);
  answer("taken");
  expect(await sent).toBe("taken");
  expect(uploads.value).toEqual([]);
});

it("why a file was refused stays until it is dismissed, and one that was stopped leaves nothing", async () => {
  const refuse = () => Promise.reject(new ServiceError("it is no log", 422, "give a log"));
  expect(await sendFile("m", "log", file("a.lsf"), refuse)).toBeNull();
  expect(uploads.value).toMatchObject([{ name: "a.lsf", fault: "it is no log. give a log" }]);
  dismiss(uploads.value[0]?.key ?? 0);
  expect(uploads.value).toEqual([]);
  const stopped = sendFile(
    "m",
    "log",
    file("b.lsf"),
    ({ gone }) => new Promise((_, fail) => gone.addEventListener("abort", () => fail(new Error("aborted")))),
  );
  uploads.value[0]?.stop();
  expect(await stopped).toBeNull();
  expect(uploads.value).toEqual([]);
});

it("logs are sent one after the other, each when the one before has been read", async () => {
  const order: string[] = [];
  vi.spyOn(api, "sendLog").mockImplementation(async (_id, vehicle, { file: { name } }) => {
    order.push(`${name} of ${vehicle}`);
    return log(name, "waiting");
  });
  const states: LogView["state"][] = ["reading", "done"];
  vi.spyOn(api, "logs").mockImplementation(async () => [log("1.kmall", states.shift() ?? "done")]);
  const all = sendLogs("m", "wam-v", [file("1.kmall"), file("2.kmall")], () => order.push("look"));
  await vi.advanceTimersByTimeAsync(500);
  expect(order).toEqual(["1.kmall of wam-v", "look"]);
  expect([queuedOf("m"), queuedOf("other"), wouldBeLost()]).toEqual([["2.kmall"], [], true]);
  await vi.advanceTimersByTimeAsync(1000);
  await all;
  expect(order).toEqual(["1.kmall of wam-v", "look", "2.kmall of wam-v", "look"]);
  expect([queuedOf("m"), wouldBeLost()]).toEqual([[], false]);
});

it("where one is refused the others are not sent", async () => {
  const sendLog = vi.spyOn(api, "sendLog").mockRejectedValue(new ServiceError("too large", 413));
  await sendLogs("m", "", [file("1.lsf"), file("2.lsf")], () => {});
  expect(sendLog).toHaveBeenCalledTimes(1);
  expect(uploads.value).toMatchObject([{ name: "1.lsf", fault: "too large" }]);
  // Nothing that is only told would be lost, and another mission's file does not take it away.
  expect([queuedOf("m"), wouldBeLost()]).toEqual([[], false]);
  await sendFile("other", "log", file("2.lsf"), () => Promise.resolve("taken"));
  expect(uploadsOf("m", "log")).toMatchObject([{ name: "1.lsf", fault: "too large" }]);
});

it("where nobody may ask any more how far a log is, the next one is sent, and its refusal told", async () => {
  const refused = new ServiceError("sign in", 401);
  const sendLog = vi.spyOn(api, "sendLog").mockResolvedValueOnce(log("1", "waiting"));
  sendLog.mockRejectedValueOnce(refused);
  vi.spyOn(api, "logs").mockRejectedValue(refused);
  await sendLogs("m", "", [file("1.lsf"), file("2.lsf")], () => {});
  expect(uploads.value).toMatchObject([{ name: "2.lsf", fault: "sign in" }]);
});

it("a multibeam's file does not say whose it is, and logs are under way until they are read", () => {
  expect(["a.kmall", "B.GSF", "Data.lsf", "Data.lsf.gz"].map(isNameless)).toEqual([true, true, false, false]);
  expect(underWay([log("a", "done"), log("b", "failed")])).toBe(false);
  expect(underWay([log("a", "done"), log("b", "waiting")])).toBe(true);
});
