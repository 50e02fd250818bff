/** The map: MapLibre with a style drawn here and nothing fetched, so that it works without internet. */

import "maplibre-gl/dist/maplibre-gl.css";
import type * as GeoJSON from "geojson";
import {
  type AllPaintProperties,
  type ExpressionSpecification,
  type GeoJSONSource,
  type ImageSource,
  type LayerSpecification,
  Map as MapLibreMap,
  Marker,
  NavigationControl,
  ScaleControl,
  type StyleSpecification,
  setWorkerUrl,
} from "maplibre-gl";
import workerUrl from "maplibre-gl/dist/maplibre-gl-worker.mjs?url";
import type { LngLat, MapView, PolygonGeometry } from "../api/types";
import { interpolatedBlocks, type Layer, paint, type Range } from "./bathymetry";
import {
  type Bounds,
  boundsOf,
  contains,
  type Graticule,
  graticule,
  graticuleStep,
  grown,
  metresPerDegree,
  pieces,
  placeIn,
} from "./geo";

setWorkerUrl(workerUrl);

type Feature = GeoJSON.Feature<GeoJSON.Geometry, Record<string, string | number>>;

const collection = (features: Feature[]): GeoJSON.FeatureCollection => ({
  type: "FeatureCollection",
  features,
});
const feature = (geometry: GeoJSON.Geometry, properties: Record<string, string | number> = {}): Feature => ({
  type: "Feature",
  geometry,
  properties,
});
const line = (coordinates: readonly LngLat[]): GeoJSON.LineString => ({
  type: "LineString",
  coordinates: coordinates as LngLat[],
});

/** Line on the map: a vehicle's track or its route to a waypoint. */
export interface Track {
  points: readonly LngLat[];
  colour: string;
}

export interface Route extends Track {
  /** Only what the vehicle acknowledged is its route; anything before is drawn as a mere wish. */
  acknowledged: boolean;
  arrivalRadius_m: number;
}

/** Something with a shape of its own at a place, drawn by the page instead of the map. */
export interface Pin {
  key: string;
  at: LngLat;
  draw: (element: HTMLElement) => void;
  layerIndex: number;
}

/** Where the grid's lines meet the edges of the visible map, in its pixels. */
export interface GridFrame extends Graticule {
  xOf: (longitude: number) => number;
  yOf: (latitude: number) => number;
}

export interface ChartHooks {
  onCursor: (place: LngLat | null) => void;
  onCentre: (place: LngLat) => void;
  onFrame: (frame: GridFrame) => void;
}

export interface Padding {
  top: number;
  right: number;
  bottom: number;
  left: number;
}

const PAPER = {
  light: { sea: "#e6eef3", grid: "#b3c5d1", area: "#16394f", keepOut: "#9b1c1c", casing: "#ffffff" },
  dark: { sea: "#0c1922", grid: "#26404f", area: "#d5e6f0", keepOut: "#ff8f8f", casing: "#06121a" },
} as const;

const SOURCES = ["grid", "area", "keep-out", "interpolated", "tracks", "routes", "arrival", "draft"] as const;
type SourceName = (typeof SOURCES)[number];

const COLOUR: ExpressionSpecification = ["get", "colour"];

function layers(dark: boolean): LayerSpecification[] {
  const paper = dark ? PAPER.dark : PAPER.light;
  const round = { "line-cap": "round", "line-join": "round" } as const;
  return [
    { id: "sea", type: "background", paint: { "background-color": paper.sea } },
    {
      id: "sea-floor",
      type: "raster",
      source: "sea-floor",
      paint: { "raster-resampling": "nearest", "raster-fade-duration": 0 },
    },
    {
      id: "interpolated",
      type: "fill",
      source: "interpolated",
      paint: { "fill-pattern": "hatch", "fill-antialias": false },
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
      paint: { "fill-pattern": `forbidden-${dark ? "dark" : "light"}` },
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
      layout: round,
      paint: { "line-color": paper.area, "line-width": 2 },
    },
    {
      id: "draft",
      type: "line",
      source: "draft",
      paint: { "line-color": paper.area, "line-width": 2.5, "line-dasharray": [2, 2] },
    },
    {
      id: "track-casing",
      type: "line",
      source: "tracks",
      layout: round,
      paint: { "line-color": paper.casing, "line-width": 4.5, "line-opacity": 0.65 },
    },
    {
      id: "tracks",
      type: "line",
      source: "tracks",
      layout: round,
      paint: { "line-color": COLOUR, "line-width": 2 },
    },
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
  ];
}

function style(dark: boolean): StyleSpecification {
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
    layers: layers(dark),
  };
}

export class Chart {
  readonly #map: MapLibreMap;
  readonly #pins = new Map<string, Marker>();
  #areaBounds: Bounds | null = null;
  #fitting: (() => Padding) | null = null;
  /** The lines that are drawn reach beyond the window, so that most moves need no new ones. */
  #grid: { step: number; bounds: Bounds } | null = null;

  private constructor(
    map: MapLibreMap,
    readonly hooks: ChartHooks,
  ) {
    this.#map = map;
    map.on("mousemove", (e) => hooks.onCursor([e.lngLat.lng, e.lngLat.lat]));
    map.on("mouseout", () => hooks.onCursor(null));
    map.on("click", (e) => hooks.onCursor([e.lngLat.lng, e.lngLat.lat]));
    map.on("move", this.#drawGrid);
    map.on("resize", this.#drawGrid);
    map.on("resize", this.#fitAgain);
    map.on("movestart", (e) => {
      if ("originalEvent" in e && e.originalEvent) this.#fitting = null;
    });
    this.#drawGrid();
  }

  /** Makes the map inside an element; resolves when it can be drawn on. */
  static create(container: HTMLElement, centre: LngLat, dark: boolean, hooks: ChartHooks): Promise<Chart> {
    const map = new MapLibreMap({
      container,
      style: style(dark),
      center: centre,
      zoom: 18,
      minZoom: 2,
      maxZoom: 23,
      // North stays up, as on a chart: the grid's labels and the scale are read against the edges.
      dragRotate: false,
      pitchWithRotate: false,
      touchPitch: false,
      attributionControl: false,
      fadeDuration: 0,
      canvasContextAttributes: { antialias: true },
    });
    map.touchZoomRotate.disableRotation();
    map.keyboard.disableRotation();
    map.addControl(new NavigationControl({ showCompass: false }), "bottom-right");
    map.addControl(new ScaleControl({ maxWidth: 140, unit: "metric" }), "bottom-left");
    return new Promise((resolve) =>
      map.once("style.load", () => {
        // A light stripe beside a dark one shows on every depth's colour.
        map.addImage(
          "hatch",
          stripes(
            [
              ["#0d2230", 0.3, 1.5, 0],
              ["#ffffff", 0.3, 1.5, 2],
            ],
            18,
          ),
          { pixelRatio: 2 },
        );
        for (const [name, { keepOut }] of Object.entries(PAPER)) {
          map.addImage(`forbidden-${name}`, stripes([[keepOut, 0.75, 4, 0]], 24), { pixelRatio: 2 });
        }
        resolve(new Chart(map, hooks));
      }),
    );
  }

  destroy(): void {
    this.#map.remove();
  }

  setDark(dark: boolean): void {
    for (const { id, ...spec } of layers(dark)) {
      for (const [property, value] of Object.entries("paint" in spec ? (spec.paint ?? {}) : {})) {
        this.#map.setPaintProperty(id, property as keyof AllPaintProperties, value);
      }
    }
  }

  setMission(area: PolygonGeometry | null, keepOut: readonly PolygonGeometry[]): void {
    this.#set("area", area ? [feature(area)] : []);
    this.#set(
      "keep-out",
      keepOut.map((zone) => feature(zone)),
    );
    this.#areaBounds = boundsOf(area?.coordinates[0] ?? []);
  }

  setDraft(area: PolygonGeometry | null): void {
    this.#set("draft", area ? [feature(area)] : []);
  }

  /** Shows the mission's area with room for what lies over the map's edges, and goes on to until the map is moved. */
  fit(padding: () => Padding): void {
    this.#fitting = padding;
    this.#fitAgain();
  }

  setSeaFloor(map: MapView | null, layer: Layer, range: Range | null): void {
    const visible = map !== null && range !== null;
    this.#map.setLayoutProperty("sea-floor", "visibility", visible ? "visible" : "none");
    if (!visible) return;
    const [northWest, northEast, southEast, southWest] = map.corners as [LngLat, LngLat, LngLat, LngLat];
    (this.#map.getSource("sea-floor") as ImageSource).updateImage({
      image: new ImageData(paint(map, layer, range), map.cols, map.rows),
      coordinates: [northWest, northEast, southEast, southWest],
    });
  }

  setHatching(map: MapView | null): void {
    if (!map) {
      this.#set("interpolated", []);
      return;
    }
    const coordinates = interpolatedBlocks(map).map(({ west, south, east, north }) => {
      const corner = (col: number, row: number) => placeIn(map.corners, col / map.cols, row / map.rows);
      const first = corner(west, south);
      return [[first, corner(east, south), corner(east, north), corner(west, north), first]];
    });
    this.#set("interpolated", [feature({ type: "MultiPolygon", coordinates })]);
  }

  setTracks(tracks: readonly Track[]): void {
    this.#set(
      "tracks",
      tracks.flatMap((t) => pieces(t.points).map((piece) => feature(line(piece), { colour: t.colour }))),
    );
  }

  setRoutes(routes: readonly Route[]): void {
    this.#set(
      "routes",
      routes.map((r) =>
        feature(line(r.points), { colour: r.colour, state: r.acknowledged ? "acknowledged" : "sent" }),
      ),
    );
    this.#set(
      "arrival",
      routes.flatMap(({ points, colour, arrivalRadius_m }) => {
        const to = points.at(-1);
        return to ? [feature(line(circle(to, arrivalRadius_m)), { colour })] : [];
      }),
    );
  }

  setPins(pins: readonly Pin[]): void {
    const gone = new Set(this.#pins.keys());
    for (const pin of pins) {
      gone.delete(pin.key);
      let marker = this.#pins.get(pin.key);
      if (!marker) {
        const element = document.createElement("div");
        element.style.zIndex = String(pin.layerIndex);
        marker = new Marker({ element }).setLngLat(pin.at).addTo(this.#map);
        this.#pins.set(pin.key, marker);
      }
      marker.setLngLat(pin.at);
      pin.draw(marker.getElement());
    }
    for (const key of gone) {
      this.#pins.get(key)?.remove();
      this.#pins.delete(key);
    }
  }

  #set(name: SourceName, features: Feature[]): void {
    void (this.#map.getSource(name) as GeoJSONSource).setData(collection(features));
  }

  #fitAgain = (): void => {
    if (this.#fitting && this.#areaBounds) {
      this.#map.fitBounds(this.#areaBounds, { padding: this.#fitting(), animate: false, maxZoom: 21 });
    }
  };

  #drawGrid = (): void => {
    const map = this.#map;
    const box = map.getBounds();
    const bounds: Bounds = [box.getWest(), box.getSouth(), box.getEast(), box.getNorth()];
    const step = graticuleStep(bounds);
    if (this.#grid?.step !== step || !contains(this.#grid.bounds, bounds)) {
      this.#grid = { step, bounds: grown(bounds, 1) };
      const [west, south, east, north] = this.#grid.bounds;
      const { meridians, parallels } = graticule(this.#grid.bounds, step);
      this.#set("grid", [
        ...meridians.map((lng) =>
          feature(
            line([
              [lng, south],
              [lng, north],
            ]),
          ),
        ),
        ...parallels.map((lat) =>
          feature(
            line([
              [west, lat],
              [east, lat],
            ]),
          ),
        ),
      ]);
    }
    const centre = map.getCenter();
    this.hooks.onCentre([centre.lng, centre.lat]);
    this.hooks.onFrame({
      ...graticule(bounds, step),
      xOf: (lng) => map.project([lng, centre.lat]).x,
      yOf: (lat) => map.project([centre.lng, lat]).y,
    });
  };
}

function circle([lng, lat]: LngLat, radius_m: number): LngLat[] {
  const scale = metresPerDegree(lat);
  return Array.from({ length: 37 }, (_, i): LngLat => {
    const angle = (i * Math.PI) / 18;
    return [
      lng + (Math.cos(angle) * radius_m) / scale.east,
      lat + (Math.sin(angle) * radius_m) / scale.north,
    ];
  });
}

type Stripe = [colour: string, opacity: number, width: number, shift: number];

/** A square picture with diagonal stripes that join at its edges. */
function stripes(kinds: readonly Stripe[], size: number): ImageData {
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
