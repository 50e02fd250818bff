import { describe, expect, it } from "vitest";
import { CELL, SITE_COLOURS, searchMarks, siteOf, sitePicture } from "./site";

const answer = {
  mission_id: "m",
  version: 7,
  west_m: 0,
  south_m: 0,
  cell_m: 1,
  rows: 2,
  cols: 3,
  corners: [
    [0, 1],
    [1, 1],
    [1, 0],
    [0, 0],
  ] as [number, number][],
  cells: btoa(String.fromCharCode(1, 2, 3, 4, 2, 2)),
};

describe("the site of a search", () => {
  it("is painted with north up, a colour for each state", () => {
    const { pixels, width, height } = sitePicture(siteOf(answer));
    expect([width, height]).toEqual([3, 2]);
    const at = (x: number, y: number) => [...pixels.slice((y * 3 + x) * 4, (y * 3 + x) * 4 + 4)];
    expect(at(0, 1)).toEqual([...SITE_COLOURS.explored]);
    expect(at(0, 0)).toEqual([...SITE_COLOURS.found]);
    expect(at(2, 1)).toEqual([...SITE_COLOURS.known]);
    expect(at(2, 0)).toEqual([...SITE_COLOURS.unexplored]);
  });

  it("refuses an answer whose cells are not as many as it says", () => {
    expect(() => siteOf({ ...answer, rows: 3 })).toThrow("6 cells came for 3 x 3");
  });

  it("has as many codes as the service", () => {
    expect(Object.values(CELL)).toEqual([1, 2, 3, 4]);
  });

  it("has its transmitter at the entry unless it stands elsewhere", () => {
    const places = {
      goal: [1, 2] as const,
      goal_radius_m: 30,
      entry: [3, 4] as const,
      transmitter: null,
      transmitter_range_m: 200,
    };
    expect(searchMarks(places)[2]).toMatchObject({ at: [3, 4], radius_m: 200, words: "" });
    expect(searchMarks({ ...places, transmitter: [5, 6] })[2]).toMatchObject({
      at: [5, 6],
      words: "Transmitter",
    });
  });
});
