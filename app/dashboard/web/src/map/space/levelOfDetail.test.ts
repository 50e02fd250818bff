import { describe, expect, it } from "vitest";
import { Pace, shuffled } from "./levelOfDetail";

describe("what is drawn while it is turned", () => {
  it("is everything where pictures come quickly", () => {
    const pace = new Pace();
    pace.begin();
    for (let k = 0; k < 100; k++) pace.drawn(16);
    expect(pace.detail).toBe(1);
  });

  it("is half as much after every picture that took long, but never nothing", () => {
    const pace = new Pace();
    pace.begin();
    for (const took of [300, 200, 16]) pace.drawn(took);
    expect(pace.detail).toBe(1 / 4);
    for (let k = 0; k < 20; k++) pace.drawn(200);
    expect(pace.detail).toBe(1 / 32);
  });

  it("is more again after some pictures that came quickly", () => {
    const pace = new Pace();
    for (const took of [300, 200, ...Array(8).fill(16)]) pace.drawn(took);
    expect(pace.detail).toBe(1 / 2);
    for (const took of [...Array(7).fill(16), 50, ...Array(7).fill(16)]) pace.drawn(took);
    expect(pace.detail).toBe(1 / 2);
  });

  it("is more again when it is turned the next time", () => {
    const pace = new Pace();
    pace.begin();
    for (const took of [300, 200]) pace.drawn(took);
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
