import "./ChartPane.css";
import { useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Chart, GridFrame } from "../../map/canvas/chart";
import { latitude, longitude } from "../../state/format";
import { mapMenu } from "../../state/orders/orders";
import {
  chosenSounding,
  cursor,
  drawing,
  editing,
  in3d,
  isDark,
  mapCentre,
  measured,
  picking,
  theme,
} from "../../state/store";
import { say } from "../../words/say";
import { fitAsked } from "../keys";
import { Current } from "./Current";
import { overlaid } from "./layout";
import { MapTools } from "./MapTools";
import { chartFault, shownChart } from "./mapPicture";
import { follow } from "./mapUpdates";

// Most of the page's code: it is read while the service is asked, not before.
const charting = import("../../map/canvas/chart");

/** The map, following the page's state. */
export function ChartPane() {
  const container = useRef<HTMLDivElement>(null);
  const chart = useSignal<Chart | null>(null);
  const frame = useSignal<GridFrame | null>(null);

  useEffect(() => {
    const element = container.current;
    if (!element) return;
    let ended = false;
    let stop = () => {};
    const look = theme.peek() === "contrast" ? "contrast" : isDark.peek() ? "dark" : "light";
    charting
      .then(({ Chart }) => {
        if (ended) return;
        const made = new Chart(element, mapCentre.peek(), look, {
          onCursor: (place) => {
            cursor.value = place;
          },
          onClick: (place) => {
            const wanted = picking.value;
            picking.value = null;
            if (wanted) wanted.onPicked(place);
            else if (measured.value) measured.value = [...measured.value, place];
          },
          onMenu: (at, x, y) => {
            // Who draws, measures or points something out ends that first.
            const busy = drawing.value || editing.value || measured.value || picking.value;
            mapMenu.value = busy ? null : { at, x, y };
          },
          onSpot: (id) => {
            chosenSounding.value = id;
          },
          onCentre: (place) => {
            mapCentre.value = place;
          },
          onFrame: (next) => {
            frame.value = next;
          },
        });
        chart.value = made;
        shownChart.value = made;
        stop = follow(made);
      })
      .catch((error: unknown) => {
        chartFault.value = String(error);
      });
    return () => {
      ended = true;
      stop();
      shownChart.value = null;
      chart.peek()?.destroy();
    };
  }, []);

  useSignalEffect(() => {
    if (fitAsked.value > 0) chart.peek()?.fit(overlaid);
  });

  return (
    <section class="chart" aria-label={say("chartPane.map")} inert={in3d.value}>
      <div ref={container} class="chart-canvas" data-testid="map" data-ready={chart.value !== null} />
      {frame.value ? <GridLabels frame={frame.value} /> : null}
      <Current />
      <MapTools onFit={() => chart.value?.fit(overlaid)} />
    </section>
  );
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
