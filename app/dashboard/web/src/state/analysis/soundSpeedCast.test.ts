import { expect, it } from "vitest";
import { castsOf, timeOf, written } from "./soundSpeedCast";

const BODY = "0.0 1512.3\n5.0 1509.8\n20.0 1506.1\n";
const PROFILE = [
  [0, 1512.3],
  [5, 1509.8],
  [20, 1506.1],
];
const TIME = "2026-11-30T11:00:00.000Z";
const PLACE = [-8.7, 41.1];

it.each([
  ["ASVP", `( SoundVelocity 1.0 0 202611301100 41.1 -8.7 -1 0 0 SVP P 0003 )\n${BODY}`, TIME, PLACE],
  [
    "ASVP with seconds, no place",
    `( SoundVelocity  1.0 0 20261130110000 0.0 0.0 -1 0 0 X )\n${BODY}`,
    TIME,
    null,
  ],
  ["VEL of HYPACK", `FTP NEW 3 41.100000000 -8.700000000 11:00 11/30/2026\r\n${BODY}`, TIME, PLACE],
  ["VEL without a place", `FTP NEW 2\n${BODY}`, null, null],
  [
    "CARIS",
    `[SVP_VERSION_2]\ncast.svp\nSection 2026-334 11:00:00 41:06:00N 008:42:00W\n${BODY}`,
    TIME,
    PLACE,
  ],
  ["CARIS in decimals", `[SVP_VERSION_2]\nSection 2026-334 11:00:00 41.1 -8.7\n${BODY}`, TIME, PLACE],
  [
    "a table",
    `Time: 2026-11-30T12:00:00+0100\nLatitude: 41.1\nLongitude,8.7 W\nDepth;Speed\n${BODY}`,
    TIME,
    PLACE,
  ],
  [
    "degrees and minutes that are not understood",
    `Latitude: 41 06 00 N\nLongitude: -8 42 00\n${BODY}`,
    null,
    null,
  ],
  ["a profile alone", BODY, null, null],
  ["a day that no month has", `( SoundVelocity 1.0 0 202602311100 41.1 -8.7 -1 )\n${BODY}`, null, PLACE],
  [
    "a day that the year does not have",
    `[SVP_VERSION_2]\nSection 2026-366 11:00:00 41.1 -8.7\n${BODY}`,
    null,
    PLACE,
  ],
  ["a time that is none", `( SoundVelocity 1.0 0 202613991100 41.1 -8.7 -1 )\n${BODY}`, null, PLACE],
])("reads time and place of %s", (_, text, time, position) => {
  const [cast, ...others] = castsOf(text);
  expect(others).toEqual([]);
  expect(cast?.profile).toEqual(PROFILE);
  expect(cast?.time).toBe(time);
  expect(cast?.position?.map((degrees) => Number(degrees.toFixed(9))) ?? null).toEqual(position);
});

it("reads every section of a file", () => {
  const text = `[SVP_VERSION_2]\nday.svp\nSection 2026-334 11:00:00 41:06:00 -8:42:00\n${BODY}Section 2026-334 15:30:00 0 0\n0 1500\n9 1501\n`;
  const found = castsOf(text);
  expect(found.map(({ time }) => time)).toEqual([TIME, "2026-11-30T15:30:00.000Z"]);
  expect(found.map(({ position }) => position !== null)).toEqual([true, false]);
  expect(found.map(({ profile }) => profile.length)).toEqual([3, 2]);
});

it("finds no cast where no profile is", () => {
  expect(castsOf("Section 2026-334 11:00:00 41.1 -8.7\nnothing")).toEqual([]);
});

it("takes times for UTC unless they name a zone", () => {
  expect(timeOf("2026-11-30 11:00")).toBe(TIME);
  expect(timeOf("2026-11-30T11:00:00Z")).toBe(TIME);
  expect(timeOf("2026-11-30 09:30 -01:30")).toBe(TIME);
  expect(timeOf("11:00")).toBeNull();
  expect(timeOf("2026-02-31 11:00")).toBeNull();
});

it("writes a profile as it is read", () => {
  expect(castsOf(written(castsOf(BODY)[0]?.profile ?? []))[0]?.profile).toEqual(PROFILE);
});
