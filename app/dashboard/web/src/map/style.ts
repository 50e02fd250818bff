/** The map's style: drawn here, nothing is fetched, so that it works without internet. */

import type * as GeoJSON from "geojson";
import type { ExpressionSpecification, LayerSpecification, StyleSpecification } from "maplibre-gl";
import type { LngLat } from "../api/types";

export type Look = "light" | "dark" | "contrast";

export type Feature = GeoJSON.Feature<GeoJSON.Geometry, Record<string, string | number>>;

export const collection = (features: Feature[]): GeoJSON.FeatureCollection => ({
  type: "FeatureCollection",
  features,
});
export const feature = (
  geometry: GeoJSON.Geometry,
  properties: Record<string, string | number> = {},
): Feature => ({ type: "Feature", geometry, properties });
export const line = (coordinates: readonly LngLat[]): GeoJSON.LineString => ({
  type: "LineString",
  coordinates: coordinates as LngLat[],
});
export const point = (coordinates: LngLat): GeoJSON.Point => ({ type: "Point", coordinates });

export const PAPER = {
  light: {
    sea: "#e6eef3",
    grid: "#b3c5d1",
    area: "#16394f",
    keepOut: "#9b1c1c",
    casing: "#ffffff",
    ink: "#0f222d",
  },
  dark: {
    sea: "#0c1922",
    grid: "#26404f",
    area: "#d5e6f0",
    keepOut: "#ff8f8f",
    casing: "#06121a",
    ink: "#eaf2f6",
  },
  contrast: {
    sea: "#ffffff",
    grid: "#7a7a7a",
    area: "#000000",
    keepOut: "#b00000",
    casing: "#ffffff",
    ink: "#000000",
  },
} as const;

export const SOURCES = [
  "grid",
  "area",
  "keep-out",
  "contours",
  "tracks",
  "tails",
  "routes",
  "arrival",
  "com-range",
  "targets",
  "soundings",
  "draft",
  "measure",
] as const;
export type SourceName = (typeof SOURCES)[number];

const COLOUR: ExpressionSpecification = ["get", "colour"];
const ROUND = { "line-cap": "round", "line-join": "round" } as const;

export function layers(look: Look): LayerSpecification[] {
  const paper = PAPER[look];
  return [
    { id: "sea", type: "background", paint: { "background-color": paper.sea } },
    {
      id: "sea-floor",
      type: "raster",
      source: "sea-floor",
      paint: { "raster-resampling": "nearest", "raster-fade-duration": 0 },
    },
    {
      id: "contours",
      type: "line",
      source: "contours",
      paint: {
        "line-color": "#0b1b24",
        "line-width": ["case", ["get", "main"], 1.4, 0.7],
        "line-opacity": 0.75,
      },
    },
    {
      id: "contour-labels",
      type: "symbol",
      source: "contours",
      filter: ["get", "main"],
      layout: {
        "symbol-placement": "line",
        "symbol-spacing": 260,
        "text-field": ["get", "label"],
        "text-font": ["sans-serif"],
        "text-size": 12,
        "text-padding": 8,
      },
      paint: { "text-color": "#0b1b24", "text-halo-color": "rgba(255,255,255,0.85)", "text-halo-width": 1.6 },
    },
    {
      id: "grid",
      type: "line",
      source: "grid",
      paint: { "line-color": paper.grid, "line-width": 1, "line-opacity": 0.7 },
    },
    {
      id: "keep-out-fill",
      type: "fill",
      source: "keep-out",
      paint: { "fill-pattern": `forbidden-${look}` },
    },
    {
      id: "keep-out",
      type: "line",
      source: "keep-out",
      paint: { "line-color": paper.keepOut, "line-width": 2 },
    },
    {
      id: "area",
      type: "line",
      source: "area",
      layout: ROUND,
      paint: { "line-color": paper.area, "line-width": 2 },
    },
    {
      id: "draft",
      type: "line",
      source: "draft",
      paint: {
        "line-color": ["case", ["==", ["get", "kind"], "keep-out"], paper.keepOut, paper.area],
        "line-width": 2.5,
        "line-dasharray": [2, 2],
      },
    },
    {
      id: "com-range",
      type: "line",
      source: "com-range",
      paint: { "line-color": COLOUR, "line-width": 1, "line-dasharray": [4, 3] },
    },
    ...["tracks", "tails"].flatMap((source): LayerSpecification[] => [
      {
        id: `${source}-casing`,
        type: "line",
        source,
        layout: ROUND,
        paint: { "line-color": paper.casing, "line-width": 4.5, "line-opacity": 0.65 },
      },
      { id: source, type: "line", source, layout: ROUND, paint: { "line-color": COLOUR, "line-width": 2 } },
    ]),
    {
      id: "arrival",
      type: "line",
      source: "arrival",
      paint: { "line-color": COLOUR, "line-width": 1.5, "line-opacity": 0.8 },
    },
    {
      id: "routes-acknowledged",
      type: "line",
      source: "routes",
      filter: ["==", ["get", "state"], "acknowledged"],
      paint: { "line-color": COLOUR, "line-width": 2.5 },
    },
    {
      id: "routes-sent",
      type: "line",
      source: "routes",
      filter: ["==", ["get", "state"], "sent"],
      paint: { "line-color": COLOUR, "line-width": 2, "line-dasharray": [1.5, 2] },
    },
    {
      id: "targets-ellipse",
      type: "line",
      source: "targets",
      filter: ["==", ["geometry-type"], "LineString"],
      paint: {
        "line-color": paper.ink,
        "line-width": ["case", ["==", ["get", "accurate"], 1], 2, 1.5],
        "line-dasharray": [3, 2],
      },
    },
    {
      id: "targets-place",
      type: "circle",
      source: "targets",
      filter: ["==", ["geometry-type"], "Point"],
      paint: {
        "circle-radius": 6,
        "circle-color": ["case", ["==", ["get", "accurate"], 1], paper.ink, paper.casing],
        "circle-stroke-color": paper.ink,
        "circle-stroke-width": 2,
      },
    },
    {
      id: "targets-name",
      type: "symbol",
      source: "targets",
      filter: ["==", ["geometry-type"], "Point"],
      layout: {
        "text-field": ["get", "name"],
        "text-font": ["sans-serif"],
        "text-size": 12,
        "text-anchor": "left",
        "text-offset": [0.9, 0],
        "text-allow-overlap": true,
      },
      paint: { "text-color": paper.ink, "text-halo-color": paper.casing, "text-halo-width": 1.6 },
    },
    {
      id: "soundings",
      type: "circle",
      source: "soundings",
      paint: {
        "circle-radius": ["case", ["==", ["get", "chosen"], 1], 9, 5.5],
        "circle-color": ["match", ["get", "state"], "restored", "#ffffff", "doubted", "#ffd24d", "#e0452f"],
        "circle-stroke-color": "#10181d",
        "circle-stroke-width": ["case", ["==", ["get", "chosen"], 1], 3, 1.5],
      },
    },
    {
      id: "measure-casing",
      type: "line",
      source: "measure",
      paint: { "line-color": paper.casing, "line-width": 5 },
    },
    { id: "measure", type: "line", source: "measure", paint: { "line-color": paper.ink, "line-width": 2 } },
    {
      id: "measure-corners",
      type: "circle",
      source: "measure",
      paint: {
        "circle-radius": 4,
        "circle-color": paper.casing,
        "circle-stroke-color": paper.ink,
        "circle-stroke-width": 2,
      },
    },
  ];
}

export function style(look: Look): StyleSpecification {
  const empty = { type: "geojson", data: collection([]), maxzoom: 22, tolerance: 0.1 } as const;
  return {
    version: 8,
    sources: {
      "sea-floor": {
        type: "image",
        coordinates: [
          [0, 0.1],
          [0.1, 0.1],
          [0.1, 0],
          [0, 0],
        ],
      },
      ...Object.fromEntries(SOURCES.map((name) => [name, empty])),
    },
    layers: layers(look),
  };
}

type Stripe = [colour: string, opacity: number, width: number, shift: number];

/** A square picture with diagonal stripes that join at its edges. */
export function stripes(kinds: readonly Stripe[], size: number): ImageData {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  const context = canvas.getContext("2d");
  if (!context) throw new Error("This browser cannot draw on a canvas");
  for (const [colour, opacity, width, shift] of kinds) {
    context.strokeStyle = colour;
    context.globalAlpha = opacity;
    context.lineWidth = width;
    for (const start of [-size, 0, size]) {
      context.beginPath();
      context.moveTo(start + shift - width, size + width);
      context.lineTo(start + shift + size + width, -width);
      context.stroke();
    }
  }
  return context.getImageData(0, 0, size, size);
}
