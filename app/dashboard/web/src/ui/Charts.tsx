import { useComputed, useSignal, useSignalEffect } from "@preact/signals";
import { figuresOf } from "../state/history";
import type { Sample } from "../state/live";
import { fetchSteps, noteFault } from "../state/session";
import { colourOf, isDark, mission, steps, view } from "../state/store";
import { type Line, Plot } from "./Plot";

const METRICS = {
  depth_m: { title: "Depth of vehicles", unit: "m", down: true },
  altitude_m: { title: "Altitude", unit: "m", down: false },
  battery_pct: { title: "Battery", unit: "%", down: false },
  age_s: { title: "Seconds since heard", unit: "s", down: false },
} as const;

type Metric = keyof typeof METRICS;

const INKS = ["#1d5c94", "#b8442b", "#2e7d6e", "#8c50b8", "#8a6d00", "#5f6f7a", "#b03a80", "#3b7fd0"];
const DARK_INKS = ["#7ec3f5", "#ff9b7d", "#79d7c0", "#cfa6f0", "#e8cf6a", "#b6c6d2", "#f39ac8", "#9cc0ff"];

/** The mission's figures over its steps, and the vehicles' over the last hour. */
export function Charts() {
  const metric = useSignal<Metric>("depth_m");
  // The view changes several times a second; steps and samples seldom.
  const step = useComputed(() => mission.value?.progress.step);
  const samples = useComputed(() => view.value.samples);
  useSignalEffect(() => {
    step.value;
    fetchSteps().catch(noteFault);
  });
  const figures = useComputed(() => figuresOf(steps.value));
  const f = figures.value;
  const ink = isDark.value ? DARK_INKS : INKS;
  const colour = (i: number) => ink[i % ink.length] as string;
  const { title, unit, down } = METRICS[metric.value];
  const told = Object.entries(samples.value);
  const xs = (told[0]?.[1] ?? []).map((s) => s.at / 1000);
  return (
    <div class="log charts" data-testid="charts">
      {f.numbers.length === 0 ? (
        <p class="empty">Charts over steps begin with the first step.</p>
      ) : (
        <>
          <Plot
            title="Coverage and remaining landmarks"
            xs={f.numbers}
            unit="%"
            range={[0, 100]}
            lines={[
              { label: "covered", colour: colour(0), values: f.coverage },
              { label: "remaining", colour: colour(1), dash: [6, 4], values: f.remaining },
            ]}
          />
          <Plot
            title="Mean deviation of the map"
            xs={f.numbers}
            unit="m"
            lines={[{ label: "deviation", colour: colour(2), values: f.deviation }]}
          />
          <Plot
            title="Objective J"
            xs={f.numbers}
            unit=""
            lines={[{ label: "J", colour: colour(3), values: f.objective }]}
          />
          {f.terms.length > 0 ? (
            <Plot
              title="Its terms"
              xs={f.numbers}
              unit=""
              lines={f.terms.map((t, i) => ({ label: t.label, colour: colour(i), values: t.values }))}
            />
          ) : null}
        </>
      )}
      <div>
        <label class="metric">
          <span class="visually-hidden">Figure of the vehicles</span>
          <select
            value={metric.value}
            data-testid="metric"
            onChange={(event) => {
              metric.value = event.currentTarget.value as Metric;
            }}
          >
            {Object.entries(METRICS).map(([name, m]) => (
              <option key={name} value={name}>
                {m.title}
              </option>
            ))}
          </select>
        </label>
        <Plot
          title={title}
          xs={xs}
          unit={unit}
          time
          down={down}
          lines={linesOf(told, metric.value, xs.length)}
        />
      </div>
    </div>
  );
}

/** Vehicles that joined later have fewer samples: theirs are the newest. */
function linesOf(samples: readonly [string, readonly Sample[]][], metric: Metric, length: number): Line[] {
  return samples.map(([name, values]) => ({
    label: name,
    colour: colourOf.value.get(name) ?? "#888888",
    values: [
      ...Array<null>(Math.max(0, length - values.length)).fill(null),
      ...values.slice(-length).map((s) => s[metric]),
    ],
  }));
}
