/** The page's state: signals that the components and the map read. */

import { computed, effect, signal } from "@preact/signals";
import type { ServiceError } from "../api/client";
import type { SocketStatus } from "../api/socket";
import type {
  CrossoversView,
  Holidays,
  LayerView,
  LngLat,
  MissionSummary,
  MissionView,
  PlanView,
  PolygonGeometry,
  SoundingView,
  StepView,
  TelemetryView,
  VehicleView,
  WaypointView,
} from "../api/types";
import type { Bounds } from "../map/geo";
import type { NamedLine } from "../map/marks/lines";
import type { PlaceMark } from "../map/marks/marks";
import type { Site } from "../map/marks/site";
import { certaintyFor } from "../map/picture/certainty";
import { NORTH_WEST_DEG } from "../map/picture/hillshade";
import { fittingRange, type Range } from "../map/picture/layerColours";
import { type DepthPalette, vehicleColour } from "../map/picture/palette";
import type { SeaFloor } from "../map/picture/seafloor";
import { kept } from "../persistentSignal";
import type { CoordinateFormat } from "./format";
import { ageSeconds, EMPTY_VIEW, type LiveView } from "./live";

/** null until the first answer. */
export const missions = signal<readonly MissionSummary[] | null>(null);
export const fleet = signal<readonly VehicleView[]>([]);
/** What went wrong when the service was last asked for its lists; null when all is well. */
export const serviceFault = signal<ServiceError | null>(null);

export const selectedId = signal<string | null>(null);
export const view = signal<LiveView>(EMPTY_VIEW);
export const seaFloor = signal<SeaFloor | null>(null);
/** What a search knows of its site. */
export const site = signal<Site | null>(null);
/** What swath sonars missed; null while nothing is known of that. */
export const holidays = signal<Holidays | null>(null);
/** How well the survey agrees with itself where its lines cross; null while that is not known. */
export const crossovers = signal<CrossoversView | null>(null);
export const socketStatus = signal<SocketStatus | null>(null);
/** Page clock, milliseconds, ticking. */
export const now = signal(Date.now());

/** The service's clock, milliseconds: what it tells of when something was or will be is beside that, not beside this device's. */
export const serviceNow = computed(() => now.value + view.value.clockAhead_ms);

export const mission = computed(() => view.value.mission);

/** Reading more soundings and pings takes long enough to be asked for. */
const COMPARED_UNASKED = 200_000;
/** The mission whose crossings are to be compared because someone asked. */
const crossoversAsked = signal("");
/** The mission whose crossings are compared; null where someone has to ask for it. */
export const crossoversWanted = computed(() => {
  const { id = "", progress } = mission.value ?? {};
  if (!progress) return "";
  const few = progress.soundings + progress.pings <= COMPARED_UNASKED;
  return few || crossoversAsked.value === id ? id : null;
});
export const askForCrossovers = () => {
  crossoversAsked.value = mission.peek()?.id ?? "";
};
export const waypointOf = computed(
  () => new Map<string, WaypointView>((mission.value?.waypoints ?? []).map((w) => [w.vehicle, w])),
);

/** Colours follow the order in which vehicles joined, so that they stay when one leaves. */
export const colourOf = computed(() => {
  const names = new Set([
    ...(mission.value?.spec.vehicles ?? []).map((v) => v.name),
    ...(mission.value?.vehicles ?? []).map((v) => v.name),
  ]);
  return new Map([...names].map((name, index) => [name, vehicleColour(index)]));
});

/** After this long without a word a vehicle's values are drawn as old. */
export const STALE_AFTER_S = 5;

/** Whether the service tells what is now: a socket stays open for long after the network has gone. */
export const live = computed(
  () => socketStatus.value?.kind === "open" && now.value - view.value.vehiclesAt <= 1000 * STALE_AFTER_S,
);

/** When the service last answered with its lists, page clock in milliseconds. */
export const listedAt = signal(0);
const LISTS_OLD_MS = 15_000;

/** Whether the lists tell what is now: nothing of the service is, while it is silent about the mission that is shown. */
export const listsLive = computed(() => {
  const { mission: shown, vehiclesAt } = view.value;
  const status = socketStatus.value;
  // A service that says why it tells nothing of that mission is there.
  const says = status?.kind === "waiting" && status.why !== null;
  const silent = shown !== null && !says && now.value - vehiclesAt > 1000 * STALE_AFTER_S;
  return serviceFault.value === null && !silent && now.value - listedAt.value <= LISTS_OLD_MS;
});

export interface Vehicle {
  view: VehicleView;
  waypoint: WaypointView | undefined;
  colour: string;
  age_s: number | null;
  stale: boolean;
}

/** Whether a dialog lies over the page. */
export const dialogOpen = computed(
  () =>
    abortDialogOpen.value ||
    finishOpen.value ||
    lengthOpen.value ||
    preflightOpen.value ||
    linksOpen.value ||
    fleetOpen.value ||
    sitesOpen.value ||
    accountOpen.value ||
    settingsOpen.value ||
    keysOpen.value,
);

export const vehicles = computed<Vehicle[]>(() =>
  (mission.value?.vehicles ?? []).map((v) => {
    const age_s = ageSeconds(v, view.value.vehiclesAt, now.value);
    return {
      view: v,
      waypoint: waypointOf.value.get(v.name),
      colour: colourOf.value.get(v.name) ?? "#888888",
      age_s,
      stale: age_s === null || age_s > STALE_AFTER_S,
    };
  }),
);

/** Alarms that nobody has taken yet, on whichever page, newest first. */
export const openAlarms = computed(() => [...view.value.alarms].reverse());
/** For so long everyone sees who took an alarm. */
const TAKEN_SHOWN_MS = 60_000;
export const takenAlarm = computed(() => {
  const { taken } = view.value;
  const at = taken?.acknowledged_at ? Date.parse(taken.acknowledged_at) : 0;
  return serviceNow.value - at < TAKEN_SHOWN_MS ? taken : null;
});

/** Vehicles whose last stop was not acknowledged. */
export const unstopped = computed(() => {
  const answers = new Map<string, boolean>();
  for (const { kind, data } of view.value.events) {
    if (kind === "stop" && typeof data.vehicle === "string")
      answers.set(data.vehicle, data.acknowledged === true);
  }
  return new Set([...answers].flatMap(([vehicle, acknowledged]) => (acknowledged ? [] : [vehicle])));
});

export type Theme = "system" | "light" | "dark" | "contrast" | "night";
export const theme = kept<Theme>("theme", "system");
const systemDark = signal(matchMedia("(prefers-color-scheme: dark)").matches);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (e) => {
  systemDark.value = e.matches;
});
/** Whether the page is being put on paper, which is white. */
export const printing = signal(false);
export const isDark = computed(
  () =>
    !printing.value &&
    (theme.value === "system" ? systemDark.value : theme.value === "dark" || theme.value === "night"),
);

/** What maps can show, as the service says; empty until its first answer. */
export const layers = signal<readonly LayerView[]>([]);
/** Name of what the map shows. */
export const layer = signal("depth");
export const shownLayer = computed(() => layerNamed(layer.value));

export function layerNamed(name: string): LayerView | undefined {
  return layers.value.find((one) => one.name === name);
}

export const depthPalette = kept<DepthPalette>("palette", "deep");
export const showHatching = kept("hatching", true);
/** Whether cells are drawn as squares when they are enlarged. */
export const sharpCells = kept("sharp-cells", false);
/** Where the light on depths comes from, degrees from north; null: there is none. */
export const lightFrom = kept<number | null>("light", NORTH_WEST_DEG);
export const showContours = kept("contours", true);
export const showTracks = kept("tracks", true);
export const showRanges = kept("com-range", false);
export const showSite = kept("site", true);
export const showHolidays = kept("holidays", true);
export const showCrossings = kept("crossings", true);
export const showTargets = kept("targets", true);
export const showShips = kept("ships", true);
/** Ships near the mission; null where nothing listens for any. */
export const ships = computed(() => view.value.ships);
export const ownShip = computed(() => view.value.ownShip);
/** Ranges that the operator fixed, for each layer; a layer without one takes a fitting range. */
export const fixedRanges = kept<Partial<Record<string, Range>>>("ranges", {});
export const shownRange = computed(() => rangeOf(layer.value));

/** How guesses fade on the map; null while nothing is known. */
export const shownCertainty = computed(() => {
  const depths = rangeOf("depth");
  return seaFloor.value && depths ? certaintyFor(seaFloor.value.accuracy_m, depths) : null;
});

export function rangeOf(name: string): Range | null {
  const kind = layerNamed(name);
  return fixedRanges.value[name] ?? (seaFloor.value && kind ? fittingRange(seaFloor.value, kind) : null);
}

/** Layers that the service has to be asked for beside the usual ones. */
export const furtherLayers = computed<readonly string[]>(() =>
  shownLayer.value && !shownLayer.value.in_every_tile ? [layer.value] : [],
);

export const coordinateFormat = kept<CoordinateFormat>("coordinates", "decimal");
export const cursor = signal<LngLat | null>(null);
export const mapCentre = signal<LngLat>([-8.7044, 41.1854]);
/** What the map is to go to next; taken back when it has. */
export const destination = signal<Bounds | null>(null);
/** A place that was asked for, with its name if it has one; null: none is marked. */
export const marked = signal<{ at: LngLat; name?: string } | null>(null);
/** Whether a place to go to is being asked for. */
export const goingTo = signal(false);
export const in3d = signal(false);

/** Corners of the line being measured; null while nothing is measured. */
export const measured = signal<readonly LngLat[] | null>(null);

/** A mission being described: its area and zones on the map, and what is being drawn. */
export interface DraftShapes {
  /** One, or several blocks. */
  areas: readonly PolygonGeometry[];
  keepOut: readonly PolygonGeometry[];
  lines: readonly NamedLine[];
  /** Places of a search, and where vehicles come home to. */
  marks: readonly PlaceMark[];
}
/**
 * What the mission that is being described would begin with, block by block: the first `fresh` as it is described now, the
 * others as it was before.
 */
export const planned = signal<{ plans: readonly PlanView[]; fresh: number } | null>(null);
/** A place that is to be clicked on the map next. */
export const picking = signal<{ what: string; onPicked: (at: LngLat) => void } | null>(null);
export const draftShapes = signal<DraftShapes | null>(null);
export type Drawing = { what: string; shape: "polygon" | "rectangle"; onDrawn: (ring: LngLat[]) => void };
export const drawing = signal<Drawing | null>(null);
/** Corners that can be dragged; told of every change. */
export type Editing = { ring: readonly LngLat[]; onChanged: (ring: LngLat[]) => void };
export const editing = signal<Editing | null>(null);
/** Whether the corners can be dragged already. */
export const editingReady = signal(false);
/** Whether the map takes the clicks of what is being drawn; its tools are fetched when first used. */
export const drawingReady = signal(false);

/** Steps of the shown mission as far as they were asked for, and the one that is replayed; null: what is now. */
export const steps = signal<readonly StepView[]>([]);
/** What the vehicles of the shown mission told before this page heard of them; null until it was asked for. */
export const telemetry = signal<TelemetryView | null>(null);
export const replayStep = signal<number | null>(null);

/** Soundings that are not simply used, while they are looked through. */
export const reviewed = signal<readonly SoundingView[] | null>(null);
export const chosenSounding = signal<number | null>(null);

/** Height of the closed bottom strip as it came out, pixels: how much of the map lies under it. */
export const stripHeight = signal(0);

/** Whether the legend shows more than a line. */
export const legendOpen = kept("legend-open", false);
export const panelOpen = signal(matchMedia("(min-width: 1180px)").matches);
export const describing = signal(false);
/** The mission that the one being described begins as a copy of. */
export const copied = signal<MissionView | null>(null);
/** The mission that the one being described is to replace. */
export const editedMission = signal<MissionView | null>(null);
/** What is being asked before an abort: of the whole team, or of one vehicle. */
export const abortDialogOpen = signal(false);
export const abortOne = signal<string | null>(null);
/** Whether the table of all vehicles is shown. */
export const fleetOpen = signal(false);
/** Whether the sites are shown, and which one of them; empty: the newest. */
export const sitesOpen = signal(false);
export const shownSite = signal("");
export const preflightOpen = signal(false);
/** How deep it is where the shown mission goes, as typed in its checklist; it begins with what the form was told. */
export const floorDepth = signal("");
/** How deep it is where missions go that were described here, by their ids. */
export const describedDepths = new Map<string, string>();
/** Whether the link doctor is shown. */
export const linksOpen = signal(false);
/** Whether is asked if the mission is to be finished early. */
export const finishOpen = signal(false);
/** Whether is asked how long the mission is to be. */
export const lengthOpen = signal(false);
/** Whether is shown who is signed in. */
export const accountOpen = signal(false);
/** Whether is shown what each person sets for himself, and what the keys do. */
export const settingsOpen = signal(false);
export const keysOpen = signal(false);
/** Whether single keys are shortcuts; some people's aids type what they did not mean. */
export const singleKeys = kept("single-keys", true);

export type Tab =
  | "log"
  | "files"
  | "charts"
  | "soundings"
  | "corrections"
  | "imports"
  | "compare"
  | "profile";
/** What is opened above the bottom strip. */
export const tab = signal<Tab | null>(null);

effect(() => {
  const id = selectedId.value;
  replayStep.value = null;
  reviewed.value = null;
  chosenSounding.value = null;
  steps.value = [];
  telemetry.value = null;
  floorDepth.value = describedDepths.get(id ?? "") ?? "";
});
