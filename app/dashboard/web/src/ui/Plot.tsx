import "./Plot.css";
import "uplot/dist/uPlot.min.css";
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import { clock, fixed, plain } from "../state/format";
import { language, say } from "../words/say";

export interface Line {
  label: string;
  colour: string;
  dash?: number[];
  values: readonly (number | null)[];
}

interface PlotProps {
  title: string;
  /** Steps or seconds, ascending. */
  xs: readonly number[];
  lines: readonly Line[];
  unit: string;
  /** The first axis counts Unix seconds. */
  time?: boolean;
  /** Fixed ends of the value axis. */
  range?: [number, number];
  /** Larger values lie lower, as depths do. */
  down?: boolean;
}

const HEIGHT = 150;

/** Times of day, UTC; seconds only where ticks are closer than a minute. */
function clockTicks(_: uPlot, ticks: number[]): string[] {
  const [first = 0, second = first + 60] = ticks;
  const length = second - first < 60 ? 8 : 5;
  return ticks.map((seconds) => clock(new Date(seconds * 1000), "utc").slice(0, length));
}

/** A small chart of lines over steps or time; the values under the cursor stand in its legend. */
export function Plot({ title, xs, lines, unit, time = false, range, down = false }: PlotProps) {
  const box = useRef<HTMLDivElement>(null);
  const chart = useRef<uPlot | null>(null);
  const shape = `${lines.map((l) => l.label + l.colour).join()} ${unit} ${time} ${range} ${down} ${language.value}`;

  // A new chart only where its lines are others; new values are set below.
  useEffect(() => {
    const element = box.current;
    if (!element) return;
    const styles = getComputedStyle(element);
    const axis = {
      stroke: styles.getPropertyValue("--ink-2").trim() || "#667788",
      grid: { stroke: styles.getPropertyValue("--rule").trim() || "#8884", width: 1 },
      ticks: { show: false },
      font: "11px sans-serif",
    };
    const made = new uPlot(
      {
        width: Math.max(160, element.clientWidth),
        height: HEIGHT,
        cursor: { points: { size: 6 } },
        legend: { show: lines.length > 1, live: true },
        tzDate: (ts) => uPlot.tzDate(new Date(ts * 1000), "UTC"),
        scales: {
          x: { time },
          y: { ...(range ? { range } : {}), dir: down ? -1 : 1 },
        },
        axes: [
          { ...axis, space: 60, ...(time ? { values: clockTicks } : {}) },
          {
            ...axis,
            size: 46,
            values: (_, ticks) => ticks.map((v) => `${plain(v)}${unit === "%" ? " %" : ""}`),
          },
        ],
        series: [
          { label: time ? "UTC" : say("plot.step") },
          ...lines.map((l) => ({
            label: l.label,
            stroke: l.colour,
            width: 2,
            ...(l.dash ? { dash: l.dash } : {}),
            spanGaps: true,
            points: { show: false },
            value: (_: uPlot, v: number | null) => (v == null ? "–" : `${digits(v)} ${unit}`),
          })),
        ],
      },
      [[], ...lines.map(() => [])] as uPlot.AlignedData,
      element,
    );
    chart.current = made;
    const watcher = new ResizeObserver(() =>
      made.setSize({ width: Math.max(160, element.clientWidth), height: HEIGHT }),
    );
    watcher.observe(element);
    return () => {
      watcher.disconnect();
      made.destroy();
      chart.current = null;
    };
  }, [shape]);

  useEffect(() => {
    chart.current?.setData([xs, ...lines.map((l) => l.values)] as unknown as uPlot.AlignedData);
  });

  const newest = lines
    .map((l) => {
      const value = l.values.at(-1);
      return `${l.label} ${value == null ? say("asked.notKnown") : `${digits(value)} ${unit}`}`;
    })
    .join(", ");
  return (
    <figure class="plot">
      <figcaption>
        {title}
        {unit && unit !== "%" ? <small> {unit}</small> : null}
        <span class="visually-hidden">: {newest}</span>
      </figcaption>
      <div ref={box} aria-hidden="true" />
    </figure>
  );
}

const digits = (value: number) =>
  Math.abs(value) >= 100
    ? fixed(value, 0)
    : Math.abs(value) >= 10
      ? fixed(value, 1)
      : plain(Number(value.toPrecision(3)));
