/** Areas as files bring them and operators draw them: read, checked, and measured. Pure but for the XML reader. */

import { gpx, kml } from "@tmcw/togeojson";
import type { LngLat, PolygonGeometry } from "../api/types";
import { fixed } from "../state/format";
import { say } from "../words/say";
import { metresPerDegree } from "./geo";

const MOST_CORNERS = 1000;
const MOST_CELLS = 4_000_000;

/** A polygon of a ring without its closing corner, digits beyond a tenth of a millimetre cut off. */
export function polygonOf(ring: readonly LngLat[]): PolygonGeometry {
  const round = (degrees: number) => Math.round(degrees * 1e9) / 1e9;
  const corners = ring.map(([lng, lat]): LngLat => [round(lng), round(lat)]);
  return { type: "Polygon", coordinates: [[...corners, corners[0] as LngLat]] };
}

export function ringOf(polygon: PolygonGeometry): LngLat[] {
  return (polygon.coordinates[0] ?? []).slice(0, -1) as LngLat[];
}

/** What is wrong with an area; empty when it can be taken. */
export function areaFault(ring: readonly LngLat[], cell_m: number): string {
  if (ring.length < 3) return say("area.anAreaNeedsAtLeastThree");
  if (ring.length > MOST_CORNERS)
    return say("area.theAreaHasCornersAtMost", { ring: ring.length, most: MOST_CORNERS });
  if (ring.some(([lng, lat]) => !(Math.abs(lng) <= 180 && Math.abs(lat) <= 85))) {
    return say("area.aCornerLiesOutsideOf180");
  }
  const crossing = crossingOf(ring);
  if (crossing)
    return say("area.theOutlineCrossesItself", { crossing: crossing[0] + 1, crossing2: crossing[1] + 1 });
  const { east_m, north_m } = sizeOf(ring);
  if (!(cell_m > 0)) return "";
  if (Math.min(east_m, north_m) < 2 * cell_m) {
    return say("area.theAreaIsXMLess", {
      eastM: fixed(east_m, 1),
      northM: fixed(north_m, 1),
      cellM: cell_m,
    });
  }
  const cells = Math.ceil(east_m / cell_m) * Math.ceil(north_m / cell_m);
  if (cells > MOST_CELLS) {
    return say("area.theAreaHasMillionCellsOf", { cells: fixed(cells / 1e6, 1), cellM: cell_m });
  }
  return "";
}

/** Extent of the bounding box and enclosed area. */
export function sizeOf(ring: readonly LngLat[]): { east_m: number; north_m: number; area_m2: number } {
  const lats = ring.map((p) => p[1]);
  const lngs = ring.map((p) => p[0]);
  const scale = metresPerDegree((Math.min(...lats) + Math.max(...lats)) / 2);
  let twice = 0;
  ring.forEach(([lng, lat], i) => {
    const [nextLng, nextLat] = ring[(i + 1) % ring.length] as LngLat;
    twice += lng * nextLat - nextLng * lat;
  });
  return {
    east_m: (Math.max(...lngs) - Math.min(...lngs)) * scale.east,
    north_m: (Math.max(...lats) - Math.min(...lats)) * scale.north,
    area_m2: (Math.abs(twice) / 2) * scale.east * scale.north,
  };
}

/** The first two sides that cross or touch though they are no neighbours; null when the outline is simple. */
function crossingOf(ring: readonly LngLat[]): [number, number] | null {
  const n = ring.length;
  const side = (i: number) => [ring[i] as LngLat, ring[(i + 1) % n] as LngLat] as const;
  for (let i = 0; i < n; i++) {
    for (let j = i + 2; j < n; j++) {
      if (i === 0 && j === n - 1) continue;
      const [a, b] = side(i);
      const [c, d] = side(j);
      if (turn(a, b, c) * turn(a, b, d) <= 0 && turn(c, d, a) * turn(c, d, b) <= 0) return [i, j];
    }
  }
  return null;
}

const turn = (a: LngLat, b: LngLat, c: LngLat) =>
  Math.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));

export interface FoundAreas {
  area: LngLat[];
  keepOut: LngLat[][];
  /** Areas beside it: a mission has one, so which it is has to be chosen. */
  others: LngLat[][];
  /** What was done with the file, in words. */
  note: string;
}

/**
 * The polygons of a GeoJSON, KML or GPX file: the largest is the area, those that reach into it or are called keep-out are
 * zones, those that lie apart are other areas.
 */
export function areasIn(name: string, text: string): FoundAreas {
  const json = /\.(kml|gpx)$/i.test(name) || text.trimStart().startsWith("<") ? fromXml(text) : parsed(text);
  const polygons = polygonsOf(json).filter(({ ring }) => ring.length > 0);
  inDegrees(
    name,
    polygons.map(({ ring }) => ring),
  );
  const [first] = polygons;
  if (!first) throw new Error(say("area.holdsNoPolygonAnAreaIs", { name }));
  const largest = polygons.reduce((a, b) => (sizeOf(b.ring).area_m2 > sizeOf(a.ring).area_m2 ? b : a), first);
  const area =
    polygons.find((p) => !p.keepOut && p === largest) ?? polygons.find((p) => !p.keepOut) ?? largest;
  const isZone = (p: Found) => p.keepOut || reaches(p.ring, area.ring);
  const keepOut = polygons.filter((p) => p !== area && isZone(p)).map((p) => p.ring);
  const others = polygons.filter((p) => p !== area && !isZone(p)).map((p) => p.ring);
  const zones = keepOut.length ? say("area.moreAsKeepOutZone", { keepOut: keepOut.length }) : "";
  const apart = others.length ? say("area.moreAreaLiesApartAndIs", { others: others.length }) : "";
  return {
    area: area.ring,
    keepOut,
    others,
    note: say("area.areaOfCorners", { name, ring: area.ring.length, zones, apart }),
  };
}

/** Whether two rings share any place: a corner of one in the other, or sides that cross. */
function reaches(one: readonly LngLat[], other: readonly LngLat[]): boolean {
  const sides = (ring: readonly LngLat[]) =>
    ring.map((corner, i) => [corner, ring[(i + 1) % ring.length] as LngLat] as const);
  return (
    one.some((corner) => isWithin(corner, other)) ||
    other.some((corner) => isWithin(corner, one)) ||
    sides(one).some(([a, b]) =>
      sides(other).some(([c, d]) => turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0),
    )
  );
}

function isWithin([x, y]: LngLat, ring: readonly LngLat[]): boolean {
  let within = false;
  ring.forEach(([x1, y1], i) => {
    const [x2, y2] = ring[(i + 1) % ring.length] as LngLat;
    if (y1 > y !== y2 > y && x < x1 + ((y - y1) / (y2 - y1)) * (x2 - x1)) within = !within;
  });
  return within;
}

function parsed(text: string): unknown {
  try {
    return JSON.parse(text);
  } catch {
    throw new Error(say("area.theFileIsNeitherGeojsonNor"));
  }
}

/** What a KML or GPX file holds. Routes and tracks of chart plotters are outlines, closed or not. */
function fromXml(text: string): unknown {
  const document = new DOMParser().parseFromString(text, "text/xml");
  if (document.querySelector("parsererror")) throw new Error(say("area.theKmlFileCannotBeRead"));
  return document.documentElement.localName === "gpx" ? closed(gpx(document)) : kml(document);
}

/** Lines of three places and more with their first place once more at their ends. */
function closed(found: ReturnType<typeof gpx>): unknown {
  const features = found.features.map((feature) => {
    const { geometry } = feature;
    if (geometry?.type !== "LineString" || geometry.coordinates.length < 3) return feature;
    const [first] = geometry.coordinates;
    const last = geometry.coordinates.at(-1);
    if (first?.[0] === last?.[0] && first?.[1] === last?.[1]) return feature;
    return { ...feature, geometry: { ...geometry, coordinates: [...geometry.coordinates, first] } };
  });
  return { ...found, features };
}

interface Found {
  ring: LngLat[];
  keepOut: boolean;
}

function polygonsOf(value: unknown, keepOut = false): Found[] {
  if (typeof value !== "object" || value === null) return [];
  const { type, features, geometries, geometry, coordinates, properties } = value as Record<string, unknown>;
  switch (type) {
    case "FeatureCollection":
      return listIn(features).flatMap((one) => polygonsOf(one));
    case "GeometryCollection":
      return listIn(geometries).flatMap((one) => polygonsOf(one, keepOut));
    case "Feature": {
      const words = Object.values((properties as Record<string, unknown>) ?? {}).join(" ");
      return polygonsOf(geometry, /keep[\s_-]?out|exclu|forbidden|no[\s_-]?go/i.test(words));
    }
    case "Polygon":
      return listIn(coordinates).map((ring, i) => ({
        ring: cleaned(ring),
        keepOut: keepOut || i > 0,
      }));
    case "MultiPolygon":
      return listIn(coordinates).flatMap((one) => polygonsOf({ type: "Polygon", coordinates: one }, keepOut));
    case "LineString": {
      // A closed line is what many chart plotters write for an area.
      const ring = cleaned(coordinates);
      return ring.length > 2 && ring.length < listIn(coordinates).length ? [{ ring, keepOut }] : [];
    }
    default:
      return [];
  }
}

const listIn = (value: unknown): unknown[] => (Array.isArray(value) ? value : []);

/** A ring as a file has it, without its closing corner. */
function cleaned(ring: unknown): LngLat[] {
  const corners = listIn(ring).map((position) => {
    const [lng, lat] = listIn(position);
    if (typeof lng !== "number" || typeof lat !== "number") throw new Error(say("area.aCornerOfTheFileHas"));
    return [lng, lat] as LngLat;
  });
  const [a, b] = [corners[0], corners.at(-1)];
  return a && b && corners.length > 1 && a[0] === b[0] && a[1] === b[1] ? corners.slice(0, -1) : corners;
}

/** Refuses rings that no map can show: of metres, as in UTM. */
export function inDegrees(name: string, rings: readonly (readonly LngLat[])[]): void {
  const off = rings.flat().find(([lng, lat]) => !(Math.abs(lng) <= 180 && Math.abs(lat) <= 90));
  if (off) throw new Error(say("area.isNotInDegrees", { name, x: off[0], y: off[1] }));
}
