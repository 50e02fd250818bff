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
  ["tabs and decimal commas", "0,0\t1512,3\n5,0\t1509,8\n20,0\t1506,1"],
  ["a cast down and up", "0 1512.3\n5 1509.8\n20 1506.1\n12 1507\n5 1509\n0 1512"],
  ["a sonde that heaves", "0 1512.3\n5 1509.8\n4.8 1510\n5 1509.7\n20 1506.1"],
  ["the longest of several", "Section 1\n0 1500\n9 1500\nSection 2\n0 1512.3\n5 1509.8\n20 1506.1"],
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

it("is thinned to what the service takes", () => {
  const long = Array.from({ length: 5000 }, (_, i) => `${i / 10} 1500`).join("\n");
  expect(profileOf(long).length).toBeLessThanOrEqual(2000);
  expect(profileOf(long).length).toBeGreaterThan(1000);
});

it("tells its ends", () => {
  const ends = profileEnds(profileOf("0 1512.3\n5 1509.8\n20 1510.0"));
  expect(ends).toEqual({ depths: [0, 20], speeds: [1509.8, 1512.3] });
});
