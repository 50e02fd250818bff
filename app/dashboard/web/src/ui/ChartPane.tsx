import { effect, useSignal } from "@preact/signals";
import { render } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { Chart, type GridFrame, type Padding, type Pin, type Route } from "../map/chart";
import { latitude, longitude } from "../state/format";
import {
  colourOf,
  cursor,
  draftArea,
  isDark,
  layer,
  mapCentre,
  mission,
  seaFloor,
  showHatching,
  shownRange,
  vehicles,
  view,
} from "../state/store";
import { VehicleMark, WaypointMark } from "./marks";

/** The map, following the page's state. */
export function ChartPane() {
  const container = useRef<HTMLDivElement>(null);
  const chart = useSignal<Chart | null>(null);
  const frame = useSignal<GridFrame | null>(null);
  const fault = useSignal("");

  useEffect(() => {
    if (!container.current) return;
    let stop = () => {};
    Chart.create(container.current, mapCentre.peek(), isDark.peek(), {
      onCursor: (place) => {
        cursor.value = place;
      },
      onCentre: (place) => {
        mapCentre.value = place;
      },
      onFrame: (next) => {
        frame.value = next;
      },
    }).then(
      (made) => {
        chart.value = made;
        stop = follow(made);
      },
      (error: unknown) => {
        fault.value = String(error);
      },
    );
    return () => {
      stop();
      chart.peek()?.destroy();
    };
  }, []);

  return (
    <section class="chart" aria-label="Map">
      <div ref={container} class="chart-canvas" data-testid="map" data-ready={chart.value !== null} />
      {frame.value ? <GridLabels frame={frame.value} /> : null}
      <button
        type="button"
        class="tool fit"
        title="Show the whole area"
        aria-label="Show the whole area"
        onClick={() => chart.value?.fit(overlaid)}
      >
        <svg viewBox="0 0 20 20" width="17" height="17" aria-hidden="true">
          <path
            d="M2,7 V2 H7 M13,2 H18 V7 M18,13 V18 H13 M7,18 H2 V13"
            fill="none"
            stroke="currentColor"
            stroke-width="2"
          />
        </svg>
      </button>
      {fault.value ? (
        <p class="notice alarm" role="alert">
          The map cannot be drawn: {fault.value}. It needs WebGL 2: switch on hardware acceleration or use
          another browser.
        </p>
      ) : null}
    </section>
  );
}

/** Keeps the map in step with the state. Returns what ends that. */
function follow(chart: Chart): () => void {
  let shownMission = "";
  const stops = [
    effect(() => chart.setDark(isDark.value)),
    effect(() => {
      const present = mission.value;
      if ((present?.id ?? "") === shownMission) return;
      shownMission = present?.id ?? "";
      chart.setMission(present?.spec.area ?? null, present?.spec.keep_out ?? []);
      // What lies over the map is laid out first.
      requestAnimationFrame(() => chart.fit(overlaid));
    }),
    effect(() => chart.setDraft(draftArea.value)),
    effect(() => chart.setSeaFloor(seaFloor.value, layer.value, shownRange.value)),
    effect(() => chart.setHatching(showHatching.value ? seaFloor.value : null)),
    effect(() => {
      chart.setTracks(
        Object.entries(view.value.tracks).map(([name, points]) => ({
          points,
          colour: colourOf.value.get(name) ?? "#888888",
        })),
      );
    }),
    effect(() => {
      chart.setRoutes(routes());
      chart.setPins(pins());
    }),
  ];
  return () => {
    for (const stop of stops) stop();
  };
}

function routes(): Route[] {
  return vehicles.value.flatMap(({ view: { lon_deg, lat_deg }, waypoint, colour }) => {
    if (!waypoint || lon_deg === null || lat_deg === null) return [];
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
  });
}

function pins(): Pin[] {
  return vehicles.value.flatMap((vehicle) => {
    const { view: v, waypoint, colour } = vehicle;
    const made: Pin[] = [];
    if (waypoint) {
      made.push({
        key: `waypoint ${v.name}`,
        at: [waypoint.lon_deg, waypoint.lat_deg],
        layerIndex: 1,
        draw: (element) => render(<WaypointMark waypoint={waypoint} colour={colour} />, element),
      });
    }
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

/** How far panels reach over the map, as the style sheet says for this width of window. */
function overlaid(): Padding {
  const styles = getComputedStyle(document.querySelector(".app") ?? document.body);
  const pixels = (side: string) => (Number.parseFloat(styles.getPropertyValue(`--over-${side}`)) || 0) + 30;
  return { top: pixels("top"), right: pixels("right"), bottom: pixels("bottom"), left: pixels("left") };
}

function GridLabels({ frame }: { frame: GridFrame }) {
  return (
    <div class="grid-labels" aria-hidden="true">
      {frame.meridians.map((lng) => (
        <span key={`m${lng}`} class="meridian" style={{ left: `${frame.xOf(lng)}px` }}>
          {longitude(lng, frame.decimals)}
        </span>
      ))}
      {frame.parallels.map((lat) => (
        <span key={`p${lat}`} class="parallel" style={{ top: `${frame.yOf(lat)}px` }}>
          {latitude(lat, frame.decimals)}
        </span>
      ))}
    </div>
  );
}
