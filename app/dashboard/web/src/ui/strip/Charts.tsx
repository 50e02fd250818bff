import "./Charts.css";
import { useComputed, useSignal, useSignalEffect } from "@preact/signals";
import { figuresOf } from "../../state/past/history";
import { figuresOver, type Metric } from "../../state/past/telemetry";
import { fetchSteps, fetchTelemetry, noteFault } from "../../state/session";
import { hasEnded } from "../../state/stateNames";
import { colourOf, isDark, mission, selectedId, steps, telemetry, view } from "../../state/store";
import { say } from "../../words/say";
import { Choice, into, titles } from "../parts/Controls";
import { Plot } from "../parts/Plot";

const METRICS = {
  depth_m: {
    get title() {
      return say("charts.depthOfVehicles");
    },
    unit: "m",
    down: true,
  },
  altitude_m: {
    get title() {
      return say("charts.altitude");
    },
    unit: "m",
    down: false,
  },
  battery_pct: {
    get title() {
      return say("charts.battery");
    },
    unit: "%",
    down: false,
  },
  age_s: {
    get title() {
      return say("fleet.positionAge");
    },
    unit: "s",
    down: false,
  },
} as const satisfies Record<Metric, unknown>;

const INKS = ["#1d5c94", "#b8442b", "#2e7d6e", "#8c50b8", "#8a6d00", "#5f6f7a", "#b03a80", "#3b7fd0"];
const DARK_INKS = ["#7ec3f5", "#ff9b7d", "#79d7c0", "#cfa6f0", "#e8cf6a", "#b6c6d2", "#f39ac8", "#9cc0ff"];

/** The mission's figures over its steps, and the vehicles' over its whole time. */
export function Charts() {
  const metric = useSignal<Metric>("depth_m");
  // The view changes several times a second; steps and samples seldom.
  const step = useComputed(() => mission.value?.progress.step);
  const samples = useComputed(() => view.value.samples);
  const ended = useComputed(() => mission.value !== null && hasEnded(mission.value));
  useSignalEffect(() => {
    step.value;
    fetchSteps().catch(noteFault);
  });
  useSignalEffect(() => {
    selectedId.value;
    ended.value;
    // Until now; from here on the page hears by itself.
    fetchTelemetry().catch(noteFault);
  });
  const figures = useComputed(() => figuresOf(steps.value));
  const f = figures.value;
  const ink = isDark.value ? DARK_INKS : INKS;
  const colour = (i: number) => ink[i % ink.length] as string;
  const { title, unit, down } = METRICS[metric.value];
  // A step's coverage is what was ensonified where swath sonars measure.
  const isSwept = mission.value?.progress.ensonified_pct != null;
  // What is heard of vehicles after the end is no part of the mission.
  const heard = ended.value ? {} : samples.value;
  const over = figuresOver(metric.value, telemetry.value, heard);
  return (
    <div class="log charts" data-testid="charts">
      {f.numbers.length === 0 ? (
        <p class="empty">{say("charts.chartsOverStepsBeginWithThe")}</p>
      ) : (
        <>
          <Plot
            title={say(isSwept ? "charts.ensonifiedAndLeft" : "charts.knownAndLeft")}
            xs={f.numbers}
            unit="%"
            range={[0, 100]}
            lines={[
              {
                label: say(isSwept ? "charts.ensonified" : "charts.known"),
                colour: colour(0),
                values: f.coverage,
              },
              { label: say("charts.left"), colour: colour(1), dash: [6, 4], values: f.remaining },
            ]}
          />
          <Plot
            title={say("charts.meanDeviationOfTheMap")}
            xs={f.numbers}
            unit="m"
            lines={[{ label: say("charts.deviation"), colour: colour(2), values: f.deviation }]}
          />
          <Plot
            title={say("charts.objectiveJ")}
            xs={f.numbers}
            unit=""
            lines={[{ label: "J", colour: colour(3), values: f.objective }]}
          />
          {f.terms.length > 0 ? (
            <Plot
              title={say("charts.itsTerms")}
              xs={f.numbers}
              unit=""
              lines={f.terms.map((t, i) => ({ label: t.label, colour: colour(i), values: t.values }))}
            />
          ) : null}
        </>
      )}
      <div>
        <label class="metric">
          <span class="visually-hidden">{say("charts.figureOfTheVehicles")}</span>
          <Choice value={metric.value} options={titles(METRICS)} id="metric" onChoose={into(metric)} />
        </label>
        <Plot
          title={title}
          xs={over.times_s}
          unit={unit}
          time
          down={down}
          lines={over.vehicles.map(({ name, values }) => ({
            label: name,
            colour: colourOf.value.get(name) ?? "#888888",
            values,
          }))}
        />
      </div>
    </div>
  );
}
