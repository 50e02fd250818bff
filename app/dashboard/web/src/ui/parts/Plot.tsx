import "./Plot.css";
import "uplot/dist/uPlot.min.css";
import { signal, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type uPlot from "uplot";
import { csvOf, digits, fileNameOf, lineWords } from "../../state/analysis/plotFile";
import { clock, plain } from "../../state/format";
import { printing } from "../../state/store";
import { language, say } from "../../words/say";
import { Button, flips } from "./Controls";
import { save } from "./download";

/** What draws charts: fetched with the first one. */
const drawing = signal<typeof uPlot | null>(null);

export interface Line {
  label: string;
  colour: string;
  dash?: number[];
  values: readonly (number | null)[];
}

/** UTC as everywhere on the page; seconds where a tick is not a whole minute. */
const clockWords = (at_s: number): string =>
  clock(new Date(at_s * 1000), "utc").slice(0, at_s % 60 === 0 ? 5 : 8);

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

const HEIGHT = 170;
const LARGE_HEIGHT = 340;
/** Above the chart in its picture. */
const HEAD_PX = 48;

/**
 * A chart of lines over steps or time; the values under the cursor stand in its legend. Dragging over it enlarges a part,
 * a double click shows all again.
 */
export function Plot({ title, xs, lines, unit, time = false, range, down = false }: PlotProps) {
  const box = useRef<HTMLDivElement>(null);
  const chart = useRef<uPlot | null>(null);
  const large = useSignal(false);
  const zoomed = useSignal(false);
  const height = large.value ? LARGE_HEIGHT : HEIGHT;
  const shape = `${lines.map((l) => l.label + l.colour).join()} ${unit} ${time} ${range} ${down} ${large.value} ${language.value}`;

  useEffect(() => {
    import("uplot").then(
      (module) => {
        drawing.value = module.default;
      },
      // The service is gone, which is told elsewhere.
      () => undefined,
    );
  }, []);
  const Drawing = drawing.value;

  // A new chart only where its lines are others; new values are set below.
  useEffect(() => {
    const element = box.current;
    if (!element || !Drawing) return;
    // As they are when it is drawn: on paper they are others.
    const colour = (name: string, otherwise: string) => () =>
      getComputedStyle(element).getPropertyValue(name).trim() || otherwise;
    const axis = {
      stroke: colour("--ink-2", "#667788"),
      grid: { stroke: colour("--rule", "#8884"), width: 1 },
      ticks: { show: false },
      font: large.value ? "13px sans-serif" : "12px sans-serif",
    };
    const made = new Drawing(
      {
        width: Math.max(160, element.clientWidth),
        height,
        cursor: { points: { size: 6 }, drag: { x: true, y: false, dist: 5 } },
        hooks: {
          setScale: [
            (of, key) => {
              const xs = of.data[0];
              const { min, max } = of.scales.x ?? {};
              if (key !== "x" || xs.length < 2 || min == null || max == null) return;
              zoomed.value = min > (xs[0] as number) || max < (xs[xs.length - 1] as number);
            },
          ],
        },
        legend: { show: lines.length > 1, live: true },
        tzDate: (ts) => Drawing.tzDate(new Date(ts * 1000), "UTC"),
        scales: {
          x: { time },
          y: { ...(range ? { range } : {}), dir: down ? -1 : 1 },
        },
        axes: [
          { ...axis, space: 70, ...(time ? { values: (_, ticks) => ticks.map(clockWords) } : {}) },
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
      made.setSize({ width: Math.max(160, element.clientWidth), height }),
    );
    watcher.observe(element);
    let paper = printing.peek();
    const unwatched = printing.subscribe((now) => {
      // It is told at once what there is; nothing may be drawn before the first values are there.
      if (now !== paper) made.redraw(false);
      paper = now;
    });
    return () => {
      unwatched();
      watcher.disconnect();
      made.destroy();
      chart.current = null;
    };
  }, [shape, Drawing]);

  useEffect(() => {
    // What was enlarged stays so while more comes.
    chart.current?.setData(
      [xs, ...lines.map((l) => l.values)] as unknown as uPlot.AlignedData,
      !zoomed.peek(),
    );
    if (zoomed.peek()) chart.current?.redraw();
  });

  const savePicture = () => {
    const canvas = chart.current?.root.querySelector("canvas");
    if (!canvas) return;
    const paper = document.createElement("canvas");
    [paper.width, paper.height] = [canvas.width, canvas.height + HEAD_PX];
    const pen = paper.getContext("2d");
    if (!pen) return;
    const styles = getComputedStyle(canvas);
    pen.fillStyle = styles.getPropertyValue("--paper").trim() || "#ffffff";
    pen.fillRect(0, 0, paper.width, paper.height);
    pen.font = "bold 16px sans-serif";
    pen.fillStyle = styles.color;
    pen.fillText(unit ? `${title}, ${unit}` : title, 8, 20);
    lines.forEach((line, i) => {
      pen.fillStyle = line.colour;
      pen.fillText(line.label, 8 + ((i * paper.width) / lines.length) * 0.98, 40);
    });
    pen.drawImage(canvas, 0, HEAD_PX);
    paper.toBlob((blob) => {
      if (blob) save(`${fileNameOf(title)}.png`, blob);
    });
  };

  return (
    <figure class={`plot${large.value ? " large" : ""}`}>
      <figcaption>
        {title}
        {unit && unit !== "%" ? <small> {unit}</small> : null}
        <span class="plot-does">
          <Button kind="link-button" aria-pressed={large.value} onClick={flips(large)}>
            {large.value ? say("plot.smaller") : say("plot.larger")}
          </Button>
          {zoomed.value ? (
            <Button
              kind="link-button"
              onClick={() => {
                zoomed.value = false;
                chart.current?.setData(chart.current.data, true);
              }}
            >
              {say("plot.showAll")}
            </Button>
          ) : null}
          <Button
            kind="link-button"
            title={say("plot.asATable")}
            onClick={() =>
              save(`${fileNameOf(title)}.csv`, new Blob([csvOf(xs, lines, unit, time)], { type: "text/csv" }))
            }
          >
            {"CSV"}
          </Button>
          <Button kind="link-button" title={say("plot.asAPicture")} onClick={savePicture}>
            {"PNG"}
          </Button>
        </span>
      </figcaption>
      <div ref={box} aria-hidden="true" />
      <ul class={large.value ? "plot-words" : "visually-hidden"}>
        {lines.map((line) => (
          <li key={line.label}>{lineWords(line, unit)}</li>
        ))}
      </ul>
    </figure>
  );
}
