/** What vehicles told of themselves: what the service kept, and what this page heard since it follows. Pure. */

import type { TelemetryView } from "../../api/types";
import type { Sample } from "../live";

export type Metric = "depth_m" | "altitude_m" | "battery_pct" | "age_s";

export interface Figures {
  /** Unix seconds, ascending. */
  times_s: number[];
  vehicles: { name: string; values: (number | null)[] }[];
}

/** What the page heard this near to a kept moment takes its place, milliseconds. */
const NEAR_MS = 3000;

/** One figure of all vehicles over time: what this page heard, and where it was not there what the service kept. */
export function figuresOver(
  metric: Metric,
  kept: TelemetryView | null,
  heard: Readonly<Record<string, readonly Sample[]>>,
): Figures {
  const since = [...new Set(Object.values(heard).flatMap((samples) => samples.map((s) => s.at)))].sort(
    (a, b) => a - b,
  );
  let next = 0;
  const missed = (kept?.times_s ?? []).map((at) => {
    while (next < since.length && (since[next] as number) < at * 1000 - NEAR_MS) next += 1;
    return !(next < since.length && (since[next] as number) <= at * 1000 + NEAR_MS);
  });
  const before = (kept?.times_s ?? []).filter((_, i) => missed[i]);
  const times_s = [...before, ...since.map((at) => at / 1000)].sort((a, b) => a - b);
  const indexOf = new Map(times_s.map((at, index) => [at, index]));
  const names = new Set([...(kept?.vehicles ?? []).map((v) => v.vehicle), ...Object.keys(heard)]);
  const vehicles = [...names].map((name) => {
    const values = Array<number | null>(times_s.length).fill(null);
    const stored = kept?.vehicles.find((v) => v.vehicle === name)?.[metric] ?? [];
    stored
      .filter((_, i) => missed[i])
      .forEach((value, i) => {
        values[indexOf.get(before[i] as number) as number] = value;
      });
    for (const sample of heard[name] ?? []) values[indexOf.get(sample.at / 1000) as number] = sample[metric];
    return { name, values };
  });
  return { times_s, vehicles };
}
