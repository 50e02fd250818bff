/** Geometry on the ellipsoid, small areas only. */

import type { LngLat, Place, PolygonGeometry } from "../api/types";
import { niceStep } from "./picture/palette";

const WGS84_A = 6_378_137;
const WGS84_E2 = 6.694_379_990_14e-3;
const RAD = Math.PI / 180;

/** Metres per degree of latitude and of longitude at a latitude (WGS84 radii of curvature). */
export function metresPerDegree(latitude: number): { north: number; east: number } {
  const w2 = 1 - WGS84_E2 * Math.sin(latitude * RAD) ** 2;
  const meridian = (WGS84_A * (1 - WGS84_E2)) / w2 ** 1.5;
  const vertical = WGS84_A / Math.sqrt(w2);
  return { north: meridian * RAD, east: vertical * Math.cos(latitude * RAD) * RAD };
}

/** A rectangle by its south-western corner and its size in metres, as the service takes areas. */
export function rectangle(southWest: LngLat, eastSize_m: number, northSize_m: number): PolygonGeometry {
  const [west, south] = southWest;
  const scale = metresPerDegree(south);
  const east = west + eastSize_m / scale.east;
  const north = south + northSize_m / scale.north;
  const ring: LngLat[] = [
    [west, south],
    [east, south],
    [east, north],
    [west, north],
    [west, south],
  ];
  return { type: "Polygon", coordinates: [ring.map(([lng, lat]) => [round9(lng), round9(lat)])] };
}

const round9 = (degrees: number) => Math.round(degrees * 1e9) / 1e9;

export type Bounds = [west: number, south: number, east: number, north: number];

export function boundsOf(points: readonly LngLat[]): Bounds | null {
  if (points.length === 0) return null;
  const lngs = points.map((p) => p[0]);
  const lats = points.map((p) => p[1]);
  return [Math.min(...lngs), Math.min(...lats), Math.max(...lngs), Math.max(...lats)];
}

/** Bounds together with those places that make them no more than twice as wide or high. */
export function widened(bounds: Bounds, places: readonly LngLat[]): Bounds {
  const [west, south, east, north] = bounds;
  return places.reduce((found, [lng, lat]) => {
    const more: Bounds = [
      Math.min(found[0], lng),
      Math.min(found[1], lat),
      Math.max(found[2], lng),
      Math.max(found[3], lat),
    ];
    return more[2] - more[0] <= 2 * (east - west) && more[3] - more[1] <= 2 * (north - south) ? more : found;
  }, bounds);
}

/** Metres between two places, and the direction from one to the other in degrees from north; for short ways. */
export function wayBetween(from: LngLat, to: LngLat): { metres: number; bearing_deg: number } {
  const scale = metresPerDegree((from[1] + to[1]) / 2);
  // The short way over the date line.
  const east = (((to[0] - from[0] + 540) % 360) - 180) * scale.east;
  const north = (to[1] - from[1]) * scale.north;
  return {
    metres: Math.hypot(east, north),
    bearing_deg: (((Math.atan2(east, north) / RAD) % 360) + 360) % 360,
  };
}

/** A ring about a place, closed, as a line. */
export function circle([lng, lat]: Place, radius_m: number, corners = 36): LngLat[] {
  const scale = metresPerDegree(lat);
  return Array.from({ length: corners + 1 }, (_, i): LngLat => {
    const angle = (i * 2 * Math.PI) / corners;
    return [
      lng + (Math.cos(angle) * radius_m) / scale.east,
      lat + (Math.sin(angle) * radius_m) / scale.north,
    ];
  });
}

export interface Graticule {
  meridians: number[];
  parallels: number[];
  decimals: number;
}

/** A pleasant distance between lines, degrees, so that about `lines` of them cross the wider side of the bounds. */
export function graticuleStep([west, south, east, north]: Bounds, lines = 6): number {
  const scale = metresPerDegree((south + north) / 2);
  const widest = Math.max(east - west, ((north - south) * scale.north) / scale.east);
  return Math.max(1e-6, niceStep(widest / lines));
}

/** The meridians and parallels at whole multiples of a step inside bounds, and the decimals that tell them apart. */
export function graticule([west, south, east, north]: Bounds, step: number): Graticule {
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return { meridians: multiples(west, east, step), parallels: multiples(south, north, step), decimals };
}

function multiples(low: number, high: number, step: number): number[] {
  const first = Math.ceil(low / step);
  const last = Math.floor(high / step);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => (first + i) * step);
}
