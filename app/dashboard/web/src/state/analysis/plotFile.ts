/** What a chart shows as a table for other programs. Pure. */

import { say } from "../../words/say";
import { fixed, plain } from "../format";

export interface Column {
  label: string;
  values: readonly (number | null)[];
}

const quoted = (text: string) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

/** Comma-separated values, a row for each x; seconds as moments in UTC. */
export function csvOf(
  xs: readonly number[],
  columns: readonly Column[],
  unit: string,
  time: boolean,
): string {
  const head = [
    time ? "time_utc" : "step",
    ...columns.map(({ label }) => (unit ? `${label} (${unit})` : label)),
  ];
  const rows = xs.map((x, i) => [
    time ? new Date(x * 1000).toISOString() : String(x),
    ...columns.map(({ values }) => (values[i] == null ? "" : String(values[i]))),
  ]);
  return `${[head.map(quoted), ...rows].map((row) => row.join(",")).join("\r\n")}\r\n`;
}

/** What the lines of a chart did, in a sentence each: from, to, least and most. */
export function lineWords({ label, values }: Column, unit: string): string {
  const known = values.filter((v): v is number => v != null);
  if (known.length === 0) return say("plot.nothingIsKnown", { label });
  const [first, last] = [known[0] as number, known.at(-1) as number];
  const [least, most] = [known.reduce((a, b) => Math.min(a, b)), known.reduce((a, b) => Math.max(a, b))];
  const n = (value: number) => `${digits(value)}${unit ? ` ${unit}` : ""}`;
  return say("plot.fromTo", { label, last: n(last), first: n(first), least: n(least), most: n(most) });
}

export const digits = (value: number): string =>
  Math.abs(value) >= 100
    ? fixed(value, 0)
    : Math.abs(value) >= 10
      ? fixed(value, 1)
      : plain(Number(value.toPrecision(3)));

export const fileNameOf = (title: string): string => title.toLowerCase().replace(/[^a-z0-9]+/g, "-");
