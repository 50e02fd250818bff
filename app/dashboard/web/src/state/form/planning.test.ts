import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { type Answer, LatestAsker, plansOf } from "./planning";

interface Asked {
  of: string;
  gone: AbortSignal;
  answer: (found: string) => void;
}

let asked: Asked[];
let shown: [Answer<string>, boolean][];
let asker: LatestAsker<string>;

beforeEach(() => {
  vi.useFakeTimers();
  asked = [];
  shown = [];
  asker = new LatestAsker<string>(
    (of, gone) => new Promise((answer) => asked.push({ of, gone, answer })),
    (answer, current) => shown.push([answer, current]),
  );
});

afterEach(() => {
  vi.useRealTimers();
});

describe("a plan", () => {
  it("is asked for once things have settled, and only for the last of them", async () => {
    for (const of of ["a", "b", "c"]) {
      asker.want(of);
      await vi.advanceTimersByTimeAsync(50);
    }
    expect(asked).toEqual([]);
    await vi.advanceTimersByTimeAsync(200);
    expect(asked.map(({ of }) => of)).toEqual(["c"]);
    asked[0]?.answer("lines");
    await vi.advanceTimersByTimeAsync(0);
    expect(shown).toEqual([[{ found: "lines", of: "c" }, true]]);
    asker.want("c");
    await vi.advanceTimersByTimeAsync(1000);
    expect(asked.length).toBe(1);
  });

  it("is redrawn within a second while a corner is dragged without a pause", async () => {
    for (let k = 0; k < 100; k++) {
      asker.want(`at ${k}`);
      await vi.advanceTimersByTimeAsync(16);
      // Each answer takes some 100 ms.
      if (k % 6 === 5) asked.at(-1)?.answer("lines");
    }
    await vi.advanceTimersByTimeAsync(0);
    expect(shown.length).toBeGreaterThan(2);
    expect(shown.every(([, current]) => !current)).toBe(true);
    expect(asked.every(({ gone }) => !gone.aborted)).toBe(true);
  });

  it("that takes long is given up for a newer one, and all are when nobody looks any more", async () => {
    asker.want("slow");
    await vi.advanceTimersByTimeAsync(1000);
    asker.want("newer");
    expect(asked[0]?.gone.aborted).toBe(true);
    await vi.advanceTimersByTimeAsync(200);
    expect(asked[1]?.of).toBe("newer");
    asker.want(null);
    expect(asked[1]?.gone.aborted).toBe(true);
    asked[0]?.answer("late");
    asked[1]?.answer("late");
    await vi.advanceTimersByTimeAsync(0);
    expect(shown).toEqual([]);
  });
});

it("what is found of several plans is shown before the others are", async () => {
  const told: [string, boolean][] = [];
  let end = () => {};
  const partly = new LatestAsker<string>(
    async (of, _, tell) => {
      tell(`part of ${of}`);
      await new Promise<void>((go) => {
        end = go;
      });
      return `all of ${of}`;
    },
    (answer, current) => told.push(["found" in answer ? answer.found : "", current]),
  );
  partly.want("a");
  await vi.advanceTimersByTimeAsync(200);
  expect(told).toEqual([["part of a", true]]);
  partly.want("b");
  end();
  await vi.advanceTimersByTimeAsync(0);
  expect(told.at(-1)).toEqual(["all of a", false]);
});

describe("plans of several missions", () => {
  it("are asked for in their order, each with the one before, and only of what changed", async () => {
    const asked: string[] = [];
    const plans = plansOf(
      async (mission: string) => {
        asked.push(mission);
        return mission.toUpperCase();
      },
      (before: string | undefined, mission) => `${before ?? ""}${mission}`,
    );
    const { signal } = new AbortController();
    const told: string[][] = [];
    const tell = (part: string[]) => told.push(part);
    expect(await plans('["a","b"]', signal, tell)).toEqual(["A", "AB"]);
    expect(told).toEqual([["A"], ["A", "AB"]]);
    expect(await plans('["a","c"]', signal, tell)).toEqual(["A", "AC"]);
    expect(await plans('["b"]', signal, tell)).toEqual(["B"]);
    expect(asked).toEqual(["a", "Ab", "Ac", "b"]);
  });
});
