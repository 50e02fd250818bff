import { expect, it } from "vitest";
import { profileEnds, profileOf } from "./soundSpeedProfile";

it.each([
  ["blanks", "0 1512.3\n5 1509.8\n20 1506.1"],
  ["a table with a heading", "Depth (m),Sound speed (m/s)\r\n0,1512.3\r\n5,1509.8\r\n20,1506.1\r\n"],
  [
    "ASVP",
    "( SoundVelocity 1.0 0 202611301100 41.1 -8.7 -1 0 0 SVP )\n0.0 1512.3 \n5.0 1509.8\n20.0 1506.1\n",
  ],
  ["VEL", "FTP NEW 2\n0\t1512.3\n5\t1509.8\n20\t1506.1"],
  ["decimal commas", "Tiefe;Schall\n0,0;1512,3\n5,0;1509,8\n20,0;1506,1"],
  ["an upcast, with further columns", "20 1506.1 11.8 35\n5 1509.8 13 35\n0 1512.3 14 35"],
])("reads %s", (_, text) => {
  expect(profileOf(text)).toEqual([
    [0, 1512.3],
    [5, 1509.8],
    [20, 1506.1],
  ]);
});

it("finds nothing where nothing is", () => {
  expect(profileOf("")).toEqual([]);
  expect(profileOf("no profile\n# 1 2\n7\n")).toEqual([]);
});

it("tells its ends", () => {
  const ends = profileEnds(profileOf("0 1512.3\n5 1509.8\n20 1510.0"));
  expect(ends).toEqual({ depths: [0, 20], speeds: [1509.8, 1512.3] });
});
