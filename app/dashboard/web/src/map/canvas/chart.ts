/**
 * The map. MapLibre moves it and shows charts where there are some; everything else is drawn here on sheets over it.
 * Nothing is fetched, so it works without internet.
 */

import "maplibre-gl/dist/maplibre-gl.css";
import { Map as MapLibreMap, Marker, NavigationControl, ScaleControl, setWorkerUrl } from "maplibre-gl";
import workerUrl from "maplibre-gl/dist/maplibre-gl-worker.mjs?url";
import type { LngLat, PolygonGeometry } from "../../api/types";
import { say } from "../../words/say";
import { type Bounds, boundsOf, type Graticule, graticule, graticuleStep, widened } from "../geo";
import { type Harbour, harbours } from "../harbours";
import { isSame } from "../isSame";
import type { NamedLine } from "../marks/lines";
import type { PlaceMark, Route, Spot, Track } from "../marks/marks";
import type { ShipMark } from "../marks/ships";
import { type Site, sitePicture } from "../marks/site";
import type { SwathLine } from "../marks/swath";
import type { TargetMark } from "../marks/targets";
import type { PictureResult } from "../picture/picture.worker";
import { Sheets } from "./canvasLayers";
import { coasts, showsCoast } from "./coast";
import { imageOf, paintStill, type StillContent } from "./fixedMarks";
import { type LaidName, laidNames, paintNames, showsHarbours, sidesOf } from "./harbourNames";
import { type Box, boxesOf, boxOf, fitting, type Label, placed, type Side, signOf } from "./labels";
import { type Look, PAPER } from "./mapColours";
import {
  type LivelyContent,
  NOTHING,
  paintLively,
  SIGN_REACH_PX,
  type Sides,
  type Sketch,
  WORDS_FONT,
  WORDS_HEIGHT_PX,
} from "./movingMarks";
import type { Pixel } from "./polylines";
import { moved, type Projection } from "./projection";

setWorkerUrl(workerUrl);

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

/** A layer as the worker painted it, and where it lies; contours' levels are divided by `scale`. */
export interface PaintedFloor {
  corners: readonly LngLat[];
  rows: number;
  cols: number;
  picture: PictureResult;
  scale: number;
  interval: number;
}

export interface ChartHooks {
  onCursor: (place: LngLat | null) => void;
  onClick: (place: LngLat) => void;
  /** The right button, or a long touch: a place, and where on the page that is. */
  onMenu: (place: LngLat, x: number, y: number) => void;
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

/** How near to a sounding a click has to be. */
const SPOT_PX = 10;
/** How near to a ship the pointer has to be for her words. */
const POINTED_PX = 16;

type Keyed = Label & { key: string };

const markKey = ({ sign }: PlaceMark, i: number) => `mark ${i} ${sign}`;
const targetKey = ({ name }: TargetMark) => `target ${name}`;
const shipKey = (i: number) => `ship ${i}`;

/** Of MapLibre's own canvas while there is nothing on it: without a graphics card every pixel of it costs time. */
const EMPTY_RATIO = 0.1;

export class Chart {
  readonly #map: MapLibreMap;
  readonly #sheets: Sheets;
  readonly #scale = new ScaleControl({ maxWidth: 140, unit: "metric" });
  readonly #pins = new Map<string, Marker>();
  /** Sizes of pins' labels, and the sides on which all labels are. */
  readonly #labels = new Map<string, Pick<Label, "width" | "height" | "reach">>();
  #sides = new Map<string, Side>();
  #covers: readonly Box[] = [];
  #harbours: readonly Harbour[] = [];
  #look: Look;
  #still: StillContent = {
    lands: [],
    floor: null,
    hatched: true,
    area: null,
    keepOut: [],
    lines: [],
    tracks: [],
    holidays: [],
    crossings: [],
    site: null,
  };
  #lively: LivelyContent = NOTHING;
  #areaBounds: Bounds | null = null;
  #draftBounds: Bounds | null = null;
  #fitting: (() => Padding) | null = null;
  #tiles = "";
  #smooth = true;
  /** What of the world was asked for and has not come yet. */
  readonly #asked = new Set<string>();
  #styled = false;

  /** Makes the map inside an element. It is drawn on at once; what MapLibre itself shows follows when it is ready. */
  constructor(
    container: HTMLElement,
    centre: LngLat,
    look: Look,
    readonly hooks: ChartHooks,
  ) {
    const map = emptyMap(container, centre, look);
    map.once("style.load", () => {
      this.#styled = true;
      this.setLook(this.#look);
      this.#layTiles();
    });
    map.addControl(this.#scale, "bottom-left");
    this.#map = map;
    this.#look = look;
    this.#sheets = new Sheets(
      map,
      (context, at) => paintStill(context, at, at, this.#still, PAPER[this.#look]),
      (context, at) => {
        const { sides, names } = this.#layLabels(context, at);
        paintNames(context, at, names, PAPER[this.#look]);
        paintLively(context, at, this.#lively, sides, PAPER[this.#look]);
      },
    );
    map.on("mousemove", (e) => hooks.onCursor([e.lngLat.lng, e.lngLat.lat]));
    map.on("mouseout", (e) => {
      // Onto a vehicle's mark, which may have come below a pointer at rest, is not off the map.
      const to = e.originalEvent.relatedTarget;
      if (!(to instanceof Node && map.getCanvasContainer().contains(to))) hooks.onCursor(null);
    });
    map.on("click", (e) => {
      hooks.onCursor([e.lngLat.lng, e.lngLat.lat]);
      const spot = this.#spotAt(e.point.x, e.point.y);
      if (spot) hooks.onSpot(spot.id);
      else hooks.onClick([e.lngLat.lng, e.lngLat.lat]);
    });
    map.on("contextmenu", (e) => {
      e.preventDefault();
      hooks.onMenu([e.lngLat.lng, e.lngLat.lat], e.originalEvent.clientX, e.originalEvent.clientY);
    });
    map.on("move", this.#tellFrame);
    map.on("move", this.#wantWorld);
    map.on("resize", this.#tellFrame);
    map.on("resize", this.#fitAgain);
    map.on("movestart", (e) => {
      if ("originalEvent" in e && e.originalEvent) this.#fitting = null;
    });
    this.#tellFrame();
  }

  destroy(): void {
    this.#map.remove();
  }

  /** For what draws on the map by itself. */
  get map(): MapLibreMap {
    return this.#map;
  }

  setLook(look: Look): void {
    this.#look = look;
    // What MapLibre has not painted yet, or a browser leaves out, is water, too.
    this.#map.getContainer().style.backgroundColor = PAPER[look].sea;
    if (this.#styled) this.#map.setPaintProperty("sea", "background-color", PAPER[look].sea);
    this.#sheets.redraw();
  }

  /** In what the scale counts. */
  setUnits(units: "metric" | "nautical"): void {
    this.#scale.setUnit(units);
  }

  /** The part of the window that nothing covers, and the window itself. */
  seen(padding: Padding): {
    window: Projection;
    part: { left: number; top: number; width: number; height: number };
  } {
    const window = this.#sheets.projection;
    const { left, right, top, bottom } = padding;
    const width = Math.max(window.width - left - right, 1);
    const height = Math.max(window.height - top - bottom, 1);
    return { window, part: { left, top, width, height } };
  }

  /** Draws what the map shows for another window: charts under it as far as they are on the screen. */
  paintOn(context: CanvasRenderingContext2D, at: Projection, look: Look): void {
    if (this.#tiles) {
      // Within one turn of the event loop what MapLibre draws can be read.
      this.#map.redraw();
      const drawn = this.#sheets.projection;
      const { x, y, scale } = moved(drawn, at);
      const [width, height] = [drawn.width * scale, drawn.height * scale];
      const [left, top] = [x + (drawn.width - width) / 2, y + (drawn.height - height) / 2];
      context.drawImage(this.#map.getCanvas(), left, top, width, height);
    }
    paintStill(context, at, this.#sheets.projection, this.#still, PAPER[look]);
    const toTheRight = () => "right" as const;
    const labels = this.#labelsOf(context, at);
    const all = [...labels.always, ...labels.beside];
    paintNames(context, at, this.#namesBeside(context, at, boxesOf(all, all.map(toTheRight))), PAPER[look]);
    const sides = {
      marks: this.#lively.marks.map(toTheRight),
      targets: this.#lively.targets.map(toTheRight),
      ships: this.#lively.ships.map(({ alarm }) => (alarm ? "right" : null)),
    };
    paintLively(context, at, { ...this.#lively, pointed: null }, sides, PAPER[look]);
  }

  /** Charts under everything else, from a server of raster tiles; none without an address. */
  setTiles(address: string): void {
    if (address === this.#tiles) return;
    this.#tiles = address;
    this.#map.setPixelRatio(address ? devicePixelRatio : EMPTY_RATIO);
    if (this.#styled) this.#layTiles();
  }

  #layTiles(): void {
    const address = this.#tiles;
    if (this.#map.getLayer("tiles")) this.#map.removeLayer("tiles");
    if (this.#map.getSource("tiles")) this.#map.removeSource("tiles");
    if (!address) return;
    this.#map.addSource(
      "tiles",
      address.startsWith("pmtiles://")
        ? { type: "raster", url: address, tileSize: 256 }
        : { type: "raster", tiles: [address], tileSize: 256, maxzoom: 19 },
    );
    this.#map.addLayer({ id: "tiles", type: "raster", source: "tiles" });
  }

  /** `homes`: places about the area that are to be in sight, too, where they are not far away. */
  setMission(
    area: PolygonGeometry | null,
    keepOut: readonly PolygonGeometry[],
    lines: readonly NamedLine[],
    homes: readonly LngLat[],
  ): void {
    const bounds = boundsOf(area?.coordinates[0] ?? []);
    this.#areaBounds = bounds && widened(bounds, homes);
    this.#lay({ area, keepOut, lines });
  }

  /** A mission that is being described; its areas are what is to be seen meanwhile. */
  setDraft(draft: LivelyContent["draft"]): void {
    this.#draftBounds = boundsOf(draft.areas.flatMap(({ coordinates }) => coordinates[0] ?? []));
    this.#show({ draft });
  }

  /** What that mission would begin with. */
  setPlan(plan: LivelyContent["plan"]): void {
    this.#show({ plan });
  }

  /** Goes to the area of the mission that is being described, unless enough of it can be seen. */
  goToDraft(padding: () => Padding): void {
    const bounds = this.#draftBounds;
    if (!bounds || this.#isInSight(bounds, padding())) return;
    this.#map.fitBounds(bounds, { padding: padding(), animate: false, maxZoom: 19 });
  }

  goTo(bounds: Bounds, padding: Padding): void {
    this.#fitting = null;
    this.#map.fitBounds(bounds, { padding, animate: false, maxZoom: 21 });
  }

  /** Whether the middle of something lies in the free part of the map, and neither tiny nor larger than that. */
  #isInSight([west, south, east, north]: Bounds, { left, right, top, bottom }: Padding): boolean {
    const at = this.#sheets.projection;
    const [x, y] = [at.x((west + east) / 2), at.y((south + north) / 2)];
    const [free_x, free_y] = [at.width - left - right, at.height - top - bottom];
    const share = Math.max((at.x(east) - at.x(west)) / free_x, (at.y(south) - at.y(north)) / free_y);
    const within = x > left && x < at.width - right && y > top && y < at.height - bottom;
    return within && share > 0.02 && share < 1.2;
  }

  /** Shows the mission's area with room for what lies over the map's edges, and goes on to until the map is moved. */
  fit(padding: () => Padding): void {
    this.#fitting = padding;
    this.#fitAgain();
  }

  /** What lies over the map has changed: shows the area in what is left of it, unless the map was moved by hand. */
  refit(): void {
    this.#fitAgain();
  }

  /** A painted layer with its contours, whose levels are divided by `scale`; null: nothing is known. */
  setSeaFloor(painted: PaintedFloor | null): void {
    const before = this.#still.floor;
    if (!painted) {
      if (before) this.#lay({ floor: null });
      return;
    }
    const { picture, ...how } = painted;
    const { guessed, width, height, contours } = picture;
    const floor = {
      ...how,
      smooth: this.#smooth,
      image: imageOf(picture, before?.image),
      guessed: guessed && imageOf({ pixels: guessed, width, height }, before?.guessed ?? undefined),
      contours,
    };
    this.#lay({ floor });
  }

  /** Whether cells of the sea floor flow into each other, or are squares. */
  setSmooth(smooth: boolean): void {
    this.#smooth = smooth;
    const { floor } = this.#still;
    if (floor) this.#lay({ floor: { ...floor, smooth } });
  }

  /** Whether what is guessed is hatched. */
  setHatching(hatched: boolean): void {
    this.#lay({ hatched });
  }

  /** What a search knows of its site; null: there is none, or it is not shown. */
  setSite(site: Site | null): void {
    if (!site && !this.#still.site) return;
    this.#lay({
      site: site && { corners: site.corners, image: imageOf(sitePicture(site), this.#still.site?.image) },
    });
  }

  /** Places with a name: those of a search, and where vehicles come home to. */
  setPlaces(marks: readonly PlaceMark[]): void {
    this.#show({ marks });
  }

  /** The long part of the vehicles' ways; changes seldom. */
  setTracks(tracks: readonly Track[]): void {
    this.#lay({ tracks });
  }

  /** The newest part of the vehicles' ways. */
  setTails(tails: readonly Track[]): void {
    this.#show({ tails });
  }

  /** What the sonars of vehicles see now. */
  setSwaths(swaths: readonly SwathLine[]): void {
    this.#show({ swaths });
  }

  /** What swath sonars missed. */
  setHolidays(holidays: StillContent["holidays"]): void {
    if (holidays.length > 0 || this.#still.holidays.length > 0) this.#lay({ holidays });
  }

  /** Where lines cross and disagree. */
  setCrossings(crossings: StillContent["crossings"]): void {
    if (crossings.length > 0 || this.#still.crossings.length > 0) this.#lay({ crossings });
  }

  setRoutes(routes: readonly Route[]): void {
    this.#show({ routes });
  }

  setWaysHome(waysHome: readonly Track[]): void {
    this.#show({ waysHome });
  }

  /** How far each vehicle's messages reach. */
  setRanges(ranges: LivelyContent["ranges"]): void {
    this.#show({ ranges });
  }

  /** Where moving targets are thought to be. */
  setTargets(targets: readonly TargetMark[]): void {
    this.#show({ targets });
  }

  setShips(ships: readonly ShipMark[]): void {
    this.#show({ ships });
  }

  /** Where the pointer is. */
  setPointed(pointed: LngLat | null): void {
    this.#show({ pointed });
  }

  setSpots(spots: readonly Spot[]): void {
    this.#show({ spots });
  }

  setMeasure(measure: readonly LngLat[]): void {
    this.#show({ measure });
    this.#map.getCanvas().style.cursor = measure.length > 0 ? "crosshair" : "";
  }

  setSketch(sketch: Sketch | null): void {
    this.#show({ sketch });
  }

  setPins(pins: readonly Pin[]): void {
    const gone = new Set(this.#pins.keys());
    let moved = false;
    for (const pin of pins) {
      gone.delete(pin.key);
      let marker = this.#pins.get(pin.key);
      moved ||= !marker || !isSame(marker.getLngLat().toArray(), pin.at);
      if (!marker) {
        const element = document.createElement("div");
        element.style.zIndex = String(pin.layerIndex);
        marker = new Marker({ element }).setLngLat(pin.at).addTo(this.#map);
        this.#pins.set(pin.key, marker);
      }
      marker.setLngLat(pin.at);
      const element = marker.getElement();
      pin.draw(element);
      // Signs without words have no label.
      const words = element.querySelector<HTMLElement>(".mark-label");
      if (words) {
        const { offsetWidth: width, offsetHeight: height } = words;
        const label = { width, height, reach: element.offsetWidth / 2 };
        moved ||= !isSame(this.#labels.get(pin.key), label);
        this.#labels.set(pin.key, label);
      }
    }
    for (const key of gone) {
      this.#pins.get(key)?.remove();
      this.#pins.delete(key);
      this.#labels.delete(key);
    }
    if (moved || gone.size > 0) this.#sheets.refresh();
  }

  #lay(content: Partial<StillContent>): void {
    this.#still = { ...this.#still, ...content };
    this.#sheets.redraw();
  }

  #show(content: Partial<LivelyContent>): void {
    // Messages bring all of it several times a second, whether anything moved or not.
    const before = this.#lively;
    const names = Object.keys(content) as (keyof LivelyContent)[];
    if (names.every((name) => isSame(content[name], before[name]))) return;
    this.#lively = { ...this.#lively, ...content };
    this.#sheets.refresh();
  }

  /** What lies over the map, in its pixels: labels keep clear of it. */
  setCovers(covers: readonly Box[]): void {
    this.#covers = covers;
    this.#sheets.refresh();
  }

  /**
   * Labels that are always written, of vehicles first, and those that are where there is room beside them. Each has the
   * key of its sign, which stands there in any case.
   */
  #labelsOf(context: CanvasRenderingContext2D, at: Projection): { always: Keyed[]; beside: Keyed[] } {
    const { marks, targets, ships, pointed } = this.#lively;
    context.font = WORDS_FONT;
    const worded = (key: string, place: LngLat, words: string): Keyed => ({
      key,
      at: [at.x(place[0]), at.y(place[1])] as Pixel,
      width: context.measureText(words).width,
      height: WORDS_HEIGHT_PX,
      reach: SIGN_REACH_PX,
      side: this.#sides.get(key) ?? "right",
    });
    const pinned = [...this.#labels].flatMap(([key, { width, height, reach }]): Keyed[] => {
      const place = this.#pins.get(key)?.getLngLat();
      const side = this.#sides.get(key) ?? "right";
      return place ? [{ key, at: [at.x(place.lng), at.y(place.lat)], width, height, reach, side }] : [];
    });
    const isNear = ([lng, lat]: LngLat) =>
      pointed !== null && Math.hypot(at.x(pointed[0]) - at.x(lng), at.y(pointed[1]) - at.y(lat)) < POINTED_PX;
    const shipLabels = (wanted: (ship: ShipMark) => boolean) =>
      ships.flatMap((ship, i) => (wanted(ship) ? [worded(shipKey(i), ship.at, ship.words)] : []));
    return {
      always: [...pinned, ...shipLabels(({ alarm, at }) => alarm || isNear(at))],
      beside: [
        // What was asked for before what is there anyway.
        ...marks
          .map((mark, i) => ({ sign: mark.sign, label: worded(markKey(mark, i), mark.at, mark.words) }))
          .sort((a, b) => Number(b.sign === "position") - Number(a.sign === "position"))
          .map(({ label }) => label),
        ...targets.map((target) => worded(targetKey(target), target.at, target.name)),
      ],
    };
  }

  /** Finds room for labels and turns those of vehicles to their side; harbours are named where there is some left. */
  #layLabels(context: CanvasRenderingContext2D, at: Projection): { sides: Sides; names: LaidName[] } {
    const { always, beside } = this.#labelsOf(context, at);
    const sides = new Map<string, Side | null>();
    const [{ width, height }, covers] = [at, this.#covers];
    placed(always, covers, width, height).forEach((side, i) => {
      sides.set(always[i]?.key ?? "", side);
    });
    const taken = [
      ...covers,
      ...boxesOf(
        always,
        always.map(({ key }) => sides.get(key) ?? "right"),
      ),
      ...beside.map(signOf),
    ];
    fitting(beside, taken, width, height).forEach((side, i) => {
      sides.set(beside[i]?.key ?? "", side);
    });
    const written = beside.flatMap((label) => {
      const side = sides.get(label.key);
      return side ? [boxOf(label, side)] : [];
    });
    const names = this.#namesBeside(context, at, [...taken, ...written]);
    for (const [key, side] of [...sides, ...sidesOf(names)]) if (side) this.#sides.set(key, side);
    for (const { key } of always) {
      const element = this.#pins.get(key)?.getElement();
      const side = sides.get(key);
      if (element && side && element.dataset.side !== side) element.dataset.side = side;
    }
    const { marks, targets, ships } = this.#lively;
    const sideOf = (key: string) => sides.get(key) ?? null;
    return {
      sides: {
        marks: marks.map((mark, i) => sideOf(markKey(mark, i))),
        targets: targets.map((target) => sideOf(targetKey(target))),
        ships: ships.map((_, i) => sideOf(shipKey(i))),
      },
      names,
    };
  }

  #namesBeside(context: CanvasRenderingContext2D, at: Projection, taken: readonly Box[]): LaidName[] {
    return this.#tiles ? [] : laidNames(context, at, this.#harbours, taken, this.#sides);
  }

  #spotAt(x: number, y: number): Spot | null {
    const at = this.#sheets.projection;
    let nearest: Spot | null = null;
    let least = SPOT_PX;
    for (const spot of this.#lively.spots) {
      const away = Math.hypot(at.x(spot.at[0]) - x, at.y(spot.at[1]) - y);
      if (away <= least) [nearest, least] = [spot, away];
    }
    return nearest;
  }

  #fitAgain = (): void => {
    const bounds = this.#draftBounds ?? this.#areaBounds;
    if (this.#fitting && bounds) {
      this.#map.fitBounds(bounds, { padding: this.#fitting(), animate: false, maxZoom: 21 });
    }
  };

  /** Coasts and harbours are fetched when so much is seen that they tell something; charts have better ones. */
  #wantWorld = (): void => {
    if (this.#tiles !== "") {
      if (this.#still.lands.length > 0) this.#lay({ lands: [] });
      return;
    }
    const zoom = this.#map.getZoom();
    if (showsCoast(zoom) && this.#still.lands.length === 0) {
      this.#ask("coasts", coasts, (lands) => this.#lay({ lands }));
    }
    if (showsHarbours(zoom) && this.#harbours.length === 0) {
      this.#ask("harbours", harbours, (all) => {
        this.#harbours = all;
        this.#sheets.refresh();
      });
    }
  };

  #ask<T>(what: string, fetched: () => Promise<T>, take: (found: T) => void): void {
    if (this.#asked.has(what)) return;
    this.#asked.add(what);
    fetched()
      .then(take)
      // The service is gone, which is told elsewhere; the next move asks again.
      .catch(() => undefined)
      .finally(() => this.#asked.delete(what));
  }

  #tellFrame = (): void => {
    const at = this.#sheets.projection;
    const [west, north] = at.place(0, 0);
    const [east, south] = at.place(at.width, at.height);
    const bounds: Bounds = [west, south, east, north];
    this.hooks.onCentre(at.camera.centre);
    this.hooks.onFrame({
      ...graticule(bounds, graticuleStep(bounds)),
      xOf: (lng) => at.x(lng),
      yOf: (lat) => at.y(lat),
    });
  };
}

/** A map of nothing but water, which works without internet. */
function emptyMap(container: HTMLElement, centre: LngLat, look: Look): MapLibreMap {
  const map = new MapLibreMap({
    container,
    style: {
      version: 8,
      sources: {},
      layers: [{ id: "sea", type: "background", paint: { "background-color": PAPER[look].sea } }],
    },
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
    locale: {
      "Map.Title": say("chartPane.canvas"),
      "NavigationControl.ZoomIn": say("chartPane.zoomIn"),
      "NavigationControl.ZoomOut": say("chartPane.zoomOut"),
      "ScaleControl.Meters": "m",
      "ScaleControl.Kilometers": "km",
      "ScaleControl.NauticalMiles": "nmi",
    },
    pixelRatio: EMPTY_RATIO,
    canvasContextAttributes: { antialias: false },
  });
  map.touchZoomRotate.disableRotation();
  map.keyboard.disableRotation();
  map.addControl(new NavigationControl({ showCompass: false }), "bottom-right");
  return map;
}
