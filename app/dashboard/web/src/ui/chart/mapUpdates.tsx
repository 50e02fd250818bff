/** Keeps the map in step with the page's state. */

import { effect, type Signal } from "@preact/signals";
import { render } from "preact";
import SPEC from "../../api/mission.json";
import type { LngLat, MissionView, Place, PolygonGeometry, WaypointView } from "../../api/types";
import { ringOf } from "../../map/area";
import type { Chart, Pin } from "../../map/canvas/chart";
import type { Look } from "../../map/canvas/mapColours";
import type { PlanLines } from "../../map/canvas/movingMarks";
import { outliersOf, placeOf } from "../../map/marks/crossings";
import { namedLines } from "../../map/marks/lines";
import type { PlaceMark, Route, Track } from "../../map/marks/marks";
import { cutAt } from "../../map/marks/plan";
import { recoveryMarks, waitingCircle, wayHome } from "../../map/marks/recovery";
import { ownShipMark, shipMarks } from "../../map/marks/ships";
import { searchMarks } from "../../map/marks/site";
import { ringsOf, type SwathLine, swathEnds, swathOpacity } from "../../map/marks/swath";
import { targetMarks } from "../../map/marks/targets";
import { contourInterval } from "../../map/picture/contours";
import { drawnBy } from "../../map/picture/drawings";
import { paletteOf } from "../../map/picture/layerColours";
import { Painter } from "../../map/picture/painter";
import { lookupTable, vehicleColour } from "../../map/picture/palette";
import { gridPlace, type SeaFloor } from "../../map/picture/seafloor";
import { tilesAddress } from "../../state/device/baseMap";
import { ownPosition } from "../../state/device/geolocation";
import { place, units } from "../../state/format";
import { replayed } from "../../state/past/replay";
import {
  chosenSounding,
  colourOf,
  coordinateFormat,
  crossovers,
  cursor,
  depthPalette,
  destination,
  draftShapes,
  drawing,
  drawingReady,
  editing,
  editingReady,
  holidays,
  isDark,
  lightFrom,
  live,
  marked,
  measured,
  mission,
  now,
  ownShip,
  panelOpen,
  planned,
  replayStep,
  reviewed,
  seaFloor,
  sharpCells,
  ships,
  showContours,
  showCrossings,
  showHatching,
  showHolidays,
  shownCertainty,
  shownLayer,
  shownRange,
  showRanges,
  showShips,
  showSite,
  showTargets,
  showTracks,
  site,
  stripHeight,
  theme,
  type Vehicle,
  vehicles,
  view,
} from "../../state/store";
import { say } from "../../words/say";
import { TurnBackMark, VehicleMark, WaypointMark } from "../parts/marks";
import { cardsWidth, covers, legendReach, overlaid, panelWidth, shownFolded } from "./layout";

/** For measurements: when something was shown for the first time. */
function markOnce(name: string): void {
  if (performance.getEntriesByName(name).length === 0) performance.mark(name);
}

export const look = (): Look => (theme.value === "contrast" ? "contrast" : isDark.value ? "dark" : "light");

const homesOf = (spec: MissionView["spec"]) => recoveryMarks(spec, SPEC["recovery.radius_m"].default);

/** Returns what ends it. */
export function follow(chart: Chart): () => void {
  let shownMission = "";
  const stops = [
    effect(() => chart.setLook(look())),
    effect(() => chart.setTiles(tilesAddress.value)),
    effect(() => {
      const present = mission.value;
      if ((present?.id ?? "") === shownMission) return;
      shownMission = present?.id ?? "";
      const { area = null, keep_out = [], survey_lines = [] } = present?.spec ?? {};
      chart.setMission(
        area,
        keep_out,
        namedLines(survey_lines),
        present ? homesOf(present.spec).map(({ at }) => at) : [],
      );
      // What lies over the map is laid out first.
      requestAnimationFrame(() => {
        chart.fit(overlaid);
        if (present) markOnce("mission-shown");
      });
    }),
    followDraft(chart),
    effect(() => chart.setPlan(planLines())),
    effect(() => chart.setCovers(covers.value)),
    effect(() => {
      stripHeight.value;
      legendReach.value;
      panelOpen.value;
      panelWidth.value;
      cardsWidth.value;
      shownFolded.value;
      requestAnimationFrame(() => chart.refit());
    }),
    followDrawing(chart),
    followEditing(chart),
    followSeaFloor(chart),
    followTracks(chart),
    effect(() => {
      chart.setRoutes(replayStep.value === null ? routes() : []);
      chart.setWaysHome(
        replayStep.value === null ? vehicles.value.flatMap(({ view: v, colour }) => wayHome(v, colour)) : [],
      );
      chart.setPins(replayStep.value === null ? pins() : pastPins());
    }),
    effect(() => {
      const range = mission.value?.spec.limits.com_range_m;
      const reach =
        showRanges.value && range ? places().map(({ at, colour }) => ({ at, colour, radius_m: range })) : [];
      const waiting =
        replayStep.value === null
          ? vehicles.value.flatMap(({ view: v, colour }) => waitingCircle(v, colour))
          : [];
      chart.setRanges([...reach, ...waiting]);
    }),
    effect(() =>
      chart.setTargets(
        showTargets.value && replayStep.value === null ? targetMarks(mission.value?.targets ?? []) : [],
      ),
    ),
    effect(() => {
      const told = showShips.value && replayStep.value === null ? (ships.value ?? []) : [];
      chart.setShips(shipMarks(told, told.length > 0 ? silence_s() : 0));
    }),
    effect(() => {
      if (showShips.value && ships.value?.length) chart.setPointed(cursor.value);
    }),
    effect(() => chart.setSwaths(replayStep.value === null ? swaths() : [])),
    effect(() => {
      const shown = showHolidays.value && replayStep.value === null ? holidays.value : null;
      chart.setHolidays((shown?.features ?? []).map(ringsOf));
    }),
    effect(() => {
      const shown = showCrossings.value && replayStep.value === null ? crossovers.value : null;
      chart.setCrossings(shown ? outliersOf(shown).map(placeOf) : []);
    }),
    effect(() => {
      const bounds = destination.value;
      if (!bounds) return;
      chart.goTo(bounds, overlaid());
      destination.value = null;
    }),
    effect(() => chart.setSite(showSite.value && replayStep.value === null ? site.value : null)),
    effect(() => {
      const spec = mission.value?.spec;
      chart.setPlaces([
        ...(spec?.search ? searchMarks(spec.search) : []),
        ...(spec ? homesOf(spec) : []),
        ...(draftShapes.value?.marks ?? []),
        ...pointedOut(),
      ]);
    }),
    effect(() =>
      chart.setSpots(
        (reviewed.value ?? []).map((s) => ({
          id: s.id,
          at: [s.lon_deg, s.lat_deg],
          state: s.state,
          chosen: s.id === chosenSounding.value,
        })),
      ),
    ),
    effect(() => chart.setMeasure(measured.value ?? [])),
    effect(() => chart.setUnits(units.value)),
  ];
  return () => {
    for (const stop of stops) stop();
  };
}

/** The lines of the plan of what is being described, each cut where its vehicle has to turn back. */
function planLines(): PlanLines {
  const { plans, fresh } = planned.value ?? { plans: [], fresh: 0 };
  return plans.flatMap(({ vehicles }, block) =>
    vehicles.map((v, i) => {
      const [way, beyond] = cutAt(v.way, v.turn_back_m);
      // Before the next block nobody goes home.
      const home = block === plans.length - 1 ? (v.way_home ?? []) : [];
      return { old: block >= fresh, colour: vehicleColour(i), way, beyond, home };
    }),
  );
}

/** How long ago the service told of what moves; 0 while it does. */
const silence_s = (): number => (live.value ? 0 : Math.max(0, now.value - view.peek().vehiclesAt) / 1000);

/** A place that was asked for, where this device is, and where the own ship is. */
function pointedOut(): PlaceMark[] {
  const [asked, own, ship] = [marked.value, ownPosition.value, ownShip.value];
  const shown = showShips.value && replayStep.value === null;
  return [
    ...(shown && ship ? [ownShipMark(ship, live.value)] : []),
    ...(asked
      ? [
          {
            words: asked.name ?? place(asked.at, coordinateFormat.value),
            sign: "position" as const,
            at: asked.at,
            radius_m: 0,
          },
        ]
      : []),
    ...(own
      ? [{ words: say("follow.here"), sign: "own" as const, at: own.at, radius_m: own.accuracy_m }]
      : []),
  ];
}

/** While an area is being typed every digit would be another place. */
const TYPED_MS = 500;

function followDraft(chart: Chart): () => void {
  let shown = "";
  let typing: ReturnType<typeof setTimeout> | undefined;
  const stop = effect(() => {
    const areas = draftShapes.value?.areas ?? [];
    chart.setDraft({
      areas,
      keepOut: draftShapes.value?.keepOut ?? [],
      lines: draftShapes.value?.lines ?? [],
    });
    const corners = JSON.stringify(areas.map(({ coordinates }) => coordinates));
    if (corners === shown) return;
    shown = corners;
    clearTimeout(typing);
    const goTo = () => {
      // What is drawn or dragged on the map is in sight already, and the map stays where corners are clicked.
      if (!drawing.peek()) chart.goToDraft(overlaid);
    };
    if (areas.length > 0 && !drawing.peek()) typing = setTimeout(goTo, TYPED_MS);
  });
  return () => {
    clearTimeout(typing);
    stop();
  };
}

/** Fetches the map's tools when something is wanted of them, and ends them when it is not any more. */
function followTools<T>(
  signal: Signal<T | null>,
  ready: Signal<boolean>,
  begin: (tools: typeof import("../../map/canvas/areaEditor"), wanted: T) => Promise<() => void>,
): () => void {
  return effect(() => {
    const wanted = signal.value;
    ready.value = false;
    if (!wanted) return;
    let ended = false;
    let end = () => {};
    void import("../../map/canvas/areaEditor").then(async (tools) => {
      if (ended) return;
      end = await begin(tools, wanted);
      if (ended) end();
      else ready.value = true;
    });
    return () => {
      ended = true;
      end();
    };
  });
}

const followDrawing = (chart: Chart) =>
  followTools(drawing, drawingReady, ({ draw }, wanted) =>
    draw(chart, wanted.shape, (ring) => {
      wanted.onDrawn(ring);
      if (drawing.peek() === wanted) drawing.value = null;
    }),
  );

const followEditing = (chart: Chart) =>
  followTools(editing, editingReady, ({ edit }, wanted) => edit(chart, wanted.ring, wanted.onChanged));

function followSeaFloor(chart: Chart): () => void {
  let map: SeaFloor | null = null;
  let scale = 1;
  let interval = 1;
  const painter = new Painter((picture) => {
    if (!map) return;
    const { corners, rows, cols } = map;
    chart.setSeaFloor({ corners, rows, cols, picture, scale, interval });
    markOnce("sea-floor");
  });
  const stop = effect(() => {
    map = seaFloor.value;
    const range = shownRange.value;
    const shown = shownLayer.value;
    const values = shown && map?.layers[shown.name];
    const { flags, depth, uncertainty } = map?.layers ?? {};
    const wanted = showContours.value;
    const certainty = shownCertainty.value;
    const azimuth_deg = shown?.palette === "deep" ? lightFrom.value : null;
    if (!map || !range || !values || !flags || !depth) {
      painter.forget();
      chart.setSeaFloor(null);
      return;
    }
    scale = map.scales.depth ?? 1;
    interval = Math.round(contourInterval(map.min_depth_m ?? 0, map.max_depth_m ?? 1) * scale) || 1;
    const layerScale = map.scales[shown.name] ?? 1;
    const sdScale = map.scales.uncertainty ?? 1;
    painter.paint({
      painting: {
        rows: map.rows,
        cols: map.cols,
        values,
        flags,
        depths: depth,
        low: range.low * layerScale,
        high: range.high * layerScale,
        colours: drawnBy(shown) ?? lookupTable(paletteOf(shown, depthPalette.value)),
        guesses:
          certainty && uncertainty && shown.of_depths
            ? { sds: uncertainty, full: certainty.full_m * sdScale, none: certainty.none_m * sdScale }
            : null,
        light: azimuth_deg === null ? null : { azimuth_deg, cell: map.cell_m * scale },
        ring: ringIn(map, mission.peek()?.spec.area as PolygonGeometry | undefined),
      },
      interval: wanted ? interval : null,
    });
  });
  const stopSmooth = effect(() => chart.setSmooth(!sharpCells.value));
  const stopHatching = effect(() => chart.setHatching(showHatching.value));
  return () => {
    stop();
    stopSmooth();
    stopHatching();
    painter.close();
  };
}

/** An area's outline in columns and rows of a map. */
function ringIn(map: SeaFloor, area: PolygonGeometry | undefined): [number, number][] {
  return (area ? ringOf(area) : []).map((corner) => {
    const { col, row } = gridPlace(map, corner);
    return [col, row];
  });
}

function followTracks(chart: Chart): () => void {
  let shown: readonly (readonly Place[])[] = [];
  return effect(() => {
    const past = replayed.value;
    const present = Object.entries(view.value.tracks);
    const colour = (name: string) => colourOf.value.get(name) ?? "#888888";
    const old: Track[] = !showTracks.value
      ? []
      : past
        ? past.map((p) => ({ points: p.track, colour: p.colour }))
        : present.map(([name, track]) => ({ points: track.old, colour: colour(name) }));
    // The long part seldom changes; to hand it over at every message would keep the map's worker busy with nothing.
    if (old.length !== shown.length || old.some((track, i) => track.points !== shown[i])) {
      shown = old.map((track) => track.points);
      chart.setTracks(old);
    }
    const tails = past || !showTracks.value ? [] : present;
    chart.setTails(tails.map(([name, track]) => ({ points: track.tail, colour: colour(name) })));
  });
}

function places(): { at: LngLat; colour: string }[] {
  const past = replayed.value;
  if (past) return past.map(({ place, colour }) => ({ at: place, colour }));
  return vehicles.value.flatMap(({ view: { active, lon_deg, lat_deg }, colour }) =>
    !active || lon_deg === null || lat_deg === null ? [] : [{ at: [lon_deg, lat_deg] as LngLat, colour }],
  );
}

function swaths(): SwathLine[] {
  return vehicles.value.flatMap(({ view: v, colour, age_s }) => {
    const opacity = age_s === null ? 0 : swathOpacity(age_s);
    if (!v.active || !v.swath_m || opacity === 0) return [];
    if (v.lon_deg === null || v.lat_deg === null || v.heading_deg === null) return [];
    return [{ ends: swathEnds([v.lon_deg, v.lat_deg], v.heading_deg, v.swath_m), colour, opacity }];
  });
}

function routes(): Route[] {
  return [...vehicles.value.flatMap(orderedWay), ...vehicles.value.flatMap(routeOf)];
}

/** Where a vehicle was ordered: a mere wish until its legs are sent. */
function orderedWay({ view: { active, order }, colour }: Vehicle): Route[] {
  if (!active || !order || order.way.length === 0) return [];
  return [{ points: order.way, colour, acknowledged: false, arrivalRadius_m: 0 }];
}

function routeOf({ view: { active, lon_deg, lat_deg }, waypoint, colour }: Vehicle): Route[] {
  if (!active || !waypoint || lon_deg === null || lat_deg === null) return [];
  if (waypoint.status !== "sent" && waypoint.status !== "acknowledged") return [];
  return [
    {
      points: [
        [lon_deg, lat_deg],
        [waypoint.lon_deg, waypoint.lat_deg],
      ] as const,
      colour,
      acknowledged: waypoint.status === "acknowledged",
      arrivalRadius_m: waypoint.arrival_radius_m,
    },
  ];
}

function waypointPin(waypoint: WaypointView, colour: string): Pin {
  return {
    key: `waypoint ${waypoint.vehicle}`,
    at: [waypoint.lon_deg, waypoint.lat_deg],
    layerIndex: 1,
    draw: (element) => render(<WaypointMark waypoint={waypoint} colour={colour} />, element),
  };
}

function turnBackPin({ view: { name, active, turn_back_point: at }, colour }: Vehicle): Pin[] {
  if (!active || at === null) return [];
  const draw = (element: HTMLElement) => render(<TurnBackMark name={name} colour={colour} />, element);
  return [{ key: `turn-back ${name}`, at, layerIndex: 1, draw }];
}

function pins(): Pin[] {
  return vehicles.value.flatMap((vehicle) => {
    const { view: v, waypoint, colour } = vehicle;
    const made: Pin[] = waypoint && v.active ? [waypointPin(waypoint, colour)] : [];
    made.push(...turnBackPin(vehicle));
    if (v.lon_deg !== null && v.lat_deg !== null) {
      made.push({
        key: `vehicle ${v.name}`,
        at: [v.lon_deg, v.lat_deg],
        layerIndex: 2,
        draw: (element) => render(<VehicleMark vehicle={vehicle} />, element),
      });
    }
    return made;
  });
}

function pastPins(): Pin[] {
  return (replayed.value ?? []).flatMap(({ vehicle, place, colour, waypoint, track }) => {
    const before = track.at(-2);
    const mark = <VehicleMark past={{ name: vehicle, colour, from: before ?? null, at: place }} />;
    return [
      ...(waypoint ? [waypointPin(waypoint, colour)] : []),
      {
        key: `vehicle ${vehicle}`,
        at: place,
        layerIndex: 2,
        draw: (element: HTMLElement) => render(mark, element),
      },
    ];
  });
}
