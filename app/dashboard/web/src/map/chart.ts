/** The map: MapLibre with a style drawn here and nothing fetched, so that it works without internet. */

import "maplibre-gl/dist/maplibre-gl.css";
import {
  type AllLayoutProperties,
  type AllPaintProperties,
  type GeoJSONSource,
  type ImageSource,
  Map as MapLibreMap,
  Marker,
  NavigationControl,
  ScaleControl,
  setWorkerUrl,
} from "maplibre-gl";
import workerUrl from "maplibre-gl/dist/maplibre-gl-worker.mjs?url";
import type { LngLat, PolygonGeometry } from "../api/types";
import {
  type Bounds,
  boundsOf,
  circle,
  contains,
  type Graticule,
  graticule,
  graticuleStep,
  grown,
  pieces,
} from "./geo";
import type { PictureResult } from "./picture.worker";
import { placeIn } from "./seafloor";
import {
  collection,
  type Feature,
  feature,
  type Look,
  layers,
  line,
  PAPER,
  point,
  type SourceName,
  stripes,
  style,
} from "./style";

setWorkerUrl(workerUrl);

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

export interface Spot {
  id: number;
  at: LngLat;
  state: string;
  chosen: boolean;
}

/** Where the grid's lines meet the edges of the visible map, in its pixels. */
export interface GridFrame extends Graticule {
  xOf: (longitude: number) => number;
  yOf: (latitude: number) => number;
}

export interface ChartHooks {
  onCursor: (place: LngLat | null) => void;
  onClick: (place: LngLat) => void;
  onSpot: (id: number) => void;
  onCentre: (place: LngLat) => void;
  onFrame: (frame: GridFrame) => void;
}

export interface Padding {
  top: number;
  right: number;
  bottom: number;
  left: number;
}

/** Every so many contours one is drawn stronger and labelled. */
const MAIN_EVERY = 2;

export class Chart {
  readonly #map: MapLibreMap;
  readonly #pins = new Map<string, Marker>();
  #areaBounds: Bounds | null = null;
  #fitting: (() => Padding) | null = null;
  /** The lines that are drawn reach beyond the window, so that most moves need no new ones. */
  #grid: { step: number; bounds: Bounds } | null = null;
  #tiles = "";

  private constructor(
    map: MapLibreMap,
    readonly hooks: ChartHooks,
  ) {
    this.#map = map;
    map.on("mousemove", (e) => hooks.onCursor([e.lngLat.lng, e.lngLat.lat]));
    map.on("mouseout", () => hooks.onCursor(null));
    map.on("click", (e) => {
      hooks.onCursor([e.lngLat.lng, e.lngLat.lat]);
      const [spot] = map.queryRenderedFeatures(e.point, { layers: ["soundings"] });
      if (spot) hooks.onSpot(Number(spot.properties.id));
      else hooks.onClick([e.lngLat.lng, e.lngLat.lat]);
    });
    map.on("move", this.#drawGrid);
    map.on("resize", this.#drawGrid);
    map.on("resize", this.#fitAgain);
    map.on("movestart", (e) => {
      if ("originalEvent" in e && e.originalEvent) this.#fitting = null;
    });
    this.#drawGrid();
  }

  /** Makes the map inside an element; resolves when it can be drawn on. */
  static create(container: HTMLElement, centre: LngLat, look: Look, hooks: ChartHooks): Promise<Chart> {
    const map = new MapLibreMap({
      container,
      style: style(look),
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
      // Smooth edges cost a machine that draws without a graphics card six times as much as everything else.
      canvasContextAttributes: { antialias: !drawsInSoftware() },
    });
    map.touchZoomRotate.disableRotation();
    map.keyboard.disableRotation();
    map.addControl(new NavigationControl({ showCompass: false }), "bottom-right");
    map.addControl(new ScaleControl({ maxWidth: 140, unit: "metric" }), "bottom-left");
    return new Promise((resolve) =>
      map.once("style.load", () => {
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

  /** For what draws on the map by itself. */
  get map(): MapLibreMap {
    return this.#map;
  }

  setLook(look: Look): void {
    for (const { id, ...spec } of layers(look)) {
      for (const [property, value] of Object.entries("paint" in spec ? (spec.paint ?? {}) : {})) {
        this.#map.setPaintProperty(id, property as keyof AllPaintProperties, value);
      }
    }
  }

  /** Charts under everything else, from a server of raster tiles; none without an address. */
  setTiles(address: string): void {
    if (address === this.#tiles) return;
    if (this.#map.getLayer("tiles")) this.#map.removeLayer("tiles");
    if (this.#map.getSource("tiles")) this.#map.removeSource("tiles");
    this.#tiles = address;
    if (!address) return;
    this.#map.addSource(
      "tiles",
      address.startsWith("pmtiles://")
        ? { type: "raster", url: address, tileSize: 256 }
        : { type: "raster", tiles: [address], tileSize: 256, maxzoom: 19 },
    );
    this.#map.addLayer({ id: "tiles", type: "raster", source: "tiles" }, "sea-floor");
  }

  setMission(area: PolygonGeometry | null, keepOut: readonly PolygonGeometry[]): void {
    this.#set("area", area ? [feature(area)] : []);
    this.#set(
      "keep-out",
      keepOut.map((zone) => feature(zone)),
    );
    this.#areaBounds = boundsOf(area?.coordinates[0] ?? []);
  }

  setDraft(area: PolygonGeometry | null, keepOut: readonly PolygonGeometry[]): void {
    this.#set("draft", [
      ...(area ? [feature(area, { kind: "area" })] : []),
      ...keepOut.map((zone) => feature(zone, { kind: "keep-out" })),
    ]);
  }

  /** Shows the mission's area with room for what lies over the map's edges, and goes on to until the map is moved. */
  fit(padding: () => Padding): void {
    this.#fitting = padding;
    this.#fitAgain();
  }

  /** Shows a place once, as the area of a mission being described. */
  show(points: readonly LngLat[], padding: () => Padding): void {
    const bounds = boundsOf(points);
    if (bounds) this.#map.fitBounds(bounds, { padding: padding(), animate: false, maxZoom: 19 });
  }

  /** A painted layer with its contours, whose levels are divided by `scale`; null: nothing is known. */
  setSeaFloor(
    corners: readonly LngLat[],
    rows: number,
    cols: number,
    picture: PictureResult | null,
    scale: number,
    interval: number,
  ): void {
    this.#layout("sea-floor", "visibility", picture ? "visible" : "none");
    if (!picture) {
      this.#set("contours", []);
      return;
    }
    (this.#map.getSource("sea-floor") as ImageSource).updateImage({
      image: new ImageData(picture.pixels, picture.width, picture.height),
      coordinates: corners.slice(0, 4) as [LngLat, LngLat, LngLat, LngLat],
    });
    const digits = Math.max(0, -Math.floor(Math.log10(interval / scale) + 1e-9));
    this.#set(
      "contours",
      picture.contours.map(({ level, points }) => {
        const places = points.map(([col, row]) => placeIn(corners, col / cols, row / rows));
        const main = Math.round(level / interval) % MAIN_EVERY === 0;
        return {
          type: "Feature",
          geometry: line(places),
          properties: { main, label: (level / scale).toFixed(digits) },
        } as unknown as Feature;
      }),
    );
  }

  /** The long part of the vehicles' ways; changes seldom. */
  setTracks(tracks: readonly Track[]): void {
    this.#set("tracks", lines(tracks));
  }

  /** The newest part of the vehicles' ways. */
  setTails(tracks: readonly Track[]): void {
    this.#set("tails", lines(tracks));
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

  /** How far each vehicle's messages reach. */
  setRanges(rings: readonly { at: LngLat; radius_m: number; colour: string }[]): void {
    this.#set(
      "com-range",
      rings.map(({ at, radius_m, colour }) => feature(line(circle(at, radius_m, 72)), { colour })),
    );
  }

  setTargets(features: Feature[]): void {
    this.#set("targets", features);
  }

  setSpots(spots: readonly Spot[]): void {
    this.#set(
      "soundings",
      spots.map(({ id, at, state, chosen }) => feature(point(at), { id, state, chosen: chosen ? 1 : 0 })),
    );
  }

  setMeasure(points: readonly LngLat[]): void {
    this.#set("measure", [
      ...(points.length > 1 ? [feature(line(points))] : []),
      ...points.map((at) => feature(point(at))),
    ]);
    this.#map.getCanvas().style.cursor = points.length > 0 ? "crosshair" : "";
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

  #layout(id: string, property: keyof AllLayoutProperties, value: string): void {
    if (this.#map.getLayoutProperty(id, property) !== value) this.#map.setLayoutProperty(id, property, value);
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
      const across = (a: LngLat, b: LngLat) => feature(line([a, b]));
      this.#set("grid", [
        ...meridians.map((lng) => across([lng, south], [lng, north])),
        ...parallels.map((lat) => across([west, lat], [east, lat])),
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

/** Whether the browser draws without a graphics card. */
function drawsInSoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  const names = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && names ? String(gl.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

const lines = (tracks: readonly Track[]) =>
  tracks.flatMap((t) => pieces(t.points).map((piece) => feature(line(piece), { colour: t.colour })));
