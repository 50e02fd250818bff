import { expect, it } from "vitest";
import { dayAndTimeUtc, daysOf, direction, durations, fixed, metres } from "./format";

it("ranges of time are told in whole minutes from ten minutes on, and are not narrower then", () => {
  expect(durations(187, 250)).toBe("3 min 07 s to 4 min 10 s");
  expect(durations(60, 60)).toBe("1 min 00 s");
  expect(durations(828, 1216)).toBe("13 to 21 min");
  expect(durations(3020, 3890)).toBe("50 min to 1 h 05 min");
  expect(durations(900, 900)).toBe("15 min");
});

it("directions are told in three digits, north as 000", () => {
  expect([0, 7.4, 90, 359.4, 359.6].map(direction)).toEqual(["000", "007", "090", "359", "000"]);
});

it("what is rounded to nothing has no sign", () => {
  expect(metres(-0.04)).toBe("0.0 m");
  expect(fixed(-0.4, 0)).toBe("0");
  expect(fixed(-0.06, 1)).toBe("-0.1");
});

it("times that leave the page are told in UTC, and say so", () => {
  expect(dayAndTimeUtc(new Date("2026-06-01T23:30:00Z"))).toBe("1 Jun 2026, 23:30 UTC");
});

it("lines of another day tell which, in UTC", () => {
  const times = [
    "2026-06-02T00:10:00Z",
    "2026-06-01T23:50:00Z",
    "2026-06-01T22:00:00Z",
    "2026-05-30T08:00:00Z",
  ];
  expect(daysOf(times, Date.parse("2026-06-02T09:00:00Z"))).toEqual([
    null,
    "1 Jun 2026",
    null,
    "30 May 2026",
  ]);
  expect(daysOf(times.slice(0, 1), Date.parse("2026-06-03T09:00:00Z"))).toEqual(["2 Jun 2026"]);
});
