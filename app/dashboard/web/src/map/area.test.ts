import { describe, expect, it } from "vitest";
import type { LngLat } from "../api/types";
import { areaFault, areasIn, polygonOf, ringOf, sizeOf } from "./area";
import { rectangle, wayBetween } from "./geo";

const square = ringOf(rectangle([-8.705, 41.185], 100, 50));

describe("an area", () => {
  it("that can be taken has no fault", () => {
    expect(areaFault(square, 1)).toBe("");
    expect(sizeOf(square).area_m2).toBeCloseTo(5000, -1);
  });

  it.each([
    [square.slice(0, 2), 1, "three corners"],
    [[square[0], square[2], square[1], square[3]] as LngLat[], 1, "crosses itself"],
    [square, 30, "less than two cells"],
    [ringOf(rectangle([-8, 41], 9000, 9000)), 1, "million cells"],
    [square.map(([lng, lat]): LngLat => [lat * 5, lng]), 1, "this order"],
  ])("with a fault says which, %#", (ring, cell, words) => {
    expect(areaFault(ring, cell)).toContain(words);
  });

  it("closes its ring once", () => {
    expect(polygonOf(square).coordinates[0]).toHaveLength(5);
    expect(ringOf(polygonOf(square))).toEqual(square);
  });
});

describe("an area from a file", () => {
  const closed = [...square, square[0]];
  const zone = ringOf(rectangle([-8.7048, 41.1851], 10, 10));

  it("is its largest polygon; others are keep-out zones", () => {
    const features = [zone, square].map((ring) => ({
      type: "Feature",
      properties: {},
      geometry: { type: "Polygon", coordinates: [[...ring, ring[0]]] },
    }));
    const found = areasIn("quay.geojson", JSON.stringify({ type: "FeatureCollection", features }));
    expect(found.area).toEqual(square);
    expect(found.keepOut).toEqual([zone]);
    expect(found.note).toContain("1 more as keep-out zone");
  });

  it("may be a bare geometry, a closed line, or have holes", () => {
    expect(areasIn("a.json", JSON.stringify({ type: "Polygon", coordinates: [closed] })).area).toEqual(
      square,
    );
    expect(areasIn("a.json", JSON.stringify({ type: "LineString", coordinates: closed })).area).toEqual(
      square,
    );
    const holed = { type: "Polygon", coordinates: [closed, [...zone, zone[0]]] };
    expect(areasIn("a.json", JSON.stringify(holed)).keepOut).toEqual([zone]);
  });

  it("that holds none, or is no such file, is refused in words", () => {
    expect(() => areasIn("p.json", JSON.stringify({ type: "Point", coordinates: [1, 2] }))).toThrow(
      "no polygon",
    );
    expect(() => areasIn("p.json", "depth 1 2 3")).toThrow("neither GeoJSON nor KML nor GPX");
  });
});

describe("a file that is not as it should be", () => {
  it.each([
    ['{"type":"Polygon","coordinates":null}', "holds no polygon"],
    ['{"type":"Polygon","coordinates":[null]}', "holds no polygon"],
    ['{"type":"Polygon","coordinates":[[null,[1,2],[2,2]]]}', "has no numbers"],
    ['{"type":"LineString"}', "holds no polygon"],
    ['{"type":"FeatureCollection","features":{}}', "holds no polygon"],
    ['{"type":"MultiPolygon","coordinates":[5]}', "holds no polygon"],
  ])("%s is judged in the page's own words", (text, words) => {
    expect(() => areasIn("bay.geojson", text)).toThrow(words);
  });

  it("is told that metres are no degrees", () => {
    const ring = [
      [524000, 4559000],
      [524100, 4559000],
      [524100, 4559100],
      [524000, 4559000],
    ];
    expect(() => areasIn("utm.geojson", JSON.stringify({ type: "Polygon", coordinates: [ring] }))).toThrow(
      "utm.geojson: a corner is at 524000, 4559000, which is no longitude and latitude",
    );
  });
});

it("ways are measured on the ellipsoid", () => {
  const [sw, se, ne] = square as [LngLat, LngLat, LngLat];
  expect(wayBetween(sw, se)).toMatchObject({
    metres: expect.closeTo(100, 1),
    bearing_deg: expect.closeTo(90, 1),
  });
  expect(wayBetween(ne, se)).toMatchObject({
    metres: expect.closeTo(50, 1),
    bearing_deg: expect.closeTo(180, 1),
  });
});

describe("a file with several areas", () => {
  const square = (west: number, south: number, side: number): LngLat[] => [
    [west, south],
    [west + side, south],
    [west + side, south + side],
    [west, south + side],
    [west, south],
  ];
  const multi = (...rings: LngLat[][]) =>
    JSON.stringify({ type: "MultiPolygon", coordinates: rings.map((ring) => [ring]) });

  it("takes one that lies apart for another area, not for a keep-out zone", () => {
    const found = areasIn("two.geojson", multi(square(0, 0, 0.001), square(0.01, 0, 0.0008)));
    expect(found.keepOut).toEqual([]);
    expect(found.others).toHaveLength(1);
    expect(found.note).toContain("1 more area lies apart and is left out");
  });

  it("takes one within it, and one across its border, for keep-out zones", () => {
    const found = areasIn(
      "zones.geojson",
      multi(square(0, 0, 0.001), square(0.0003, 0.0003, 0.0001), square(0.0009, 0.0004, 0.0005)),
    );
    expect(found.keepOut).toHaveLength(2);
    expect(found.others).toEqual([]);
  });
});
