import { describe, expect, it } from "vitest";
import { Pace, shuffled } from "./pace";

describe("what is drawn while it is turned", () => {
  it("is everything where pictures come quickly", () => {
    const pace = new Pace();
    pace.begin();
    for (let at = 0; at < 500; at += 16) pace.drawn(at);
    expect(pace.detail).toBe(1);
  });

  it("is half as much after every picture that came late, but never nothing", () => {
    const pace = new Pace();
    pace.begin();
    for (const at of [0, 300, 500, 516]) pace.drawn(at);
    expect(pace.detail).toBe(1 / 4);
    for (let at = 700; at < 9000; at += 200) pace.drawn(at);
    expect(pace.detail).toBe(1 / 64);
  });

  it("is more again when it is turned the next time, and a pause is no late picture", () => {
    const pace = new Pace();
    pace.begin();
    for (const at of [0, 300, 500, 8000]) pace.drawn(at);
    expect(pace.detail).toBe(1 / 4);
    pace.begin();
    expect(pace.detail).toBe(1 / 2);
  });
});

describe("a shuffled order", () => {
  it("has every number once, is always the same, and its beginning lies all over", () => {
    const order = shuffled(10_000);
    expect([...order].sort((a, b) => a - b)).toEqual([...Array(10_000).keys()]);
    expect(shuffled(10_000)).toEqual(order);
    const tenths = new Set([...order.slice(0, 100)].map((i) => Math.floor(i / 1000)));
    expect(tenths.size).toBe(10);
  });
});
