import { kept } from "../persistentSignal";
import { language, locale, say } from "../words/say";

/** Numbers as an operator reads them. An en dash stands for "not known". */

const UNKNOWN = "–";

/** A number with so many decimals, as the language writes it; what is rounded to nothing has no sign. */
export function fixed(value: number, digits: number): string {
  const text = value.toFixed(digits).replace(/^-(?=[0.]*$)/, "");
  return language.value === "pt" ? text.replace(".", ",") : text;
}

/** A number as it is, as the language writes it. */
export const plain = (value: number): string =>
  language.value === "pt" ? String(value).replace(".", ",") : String(value);

/** A number as it was typed, with a point where a comma was typed. */
export const pointed = (text: string): string => text.replace(",", ".");

export type Units = "metric" | "nautical";

/** Lengths and speeds in the units that were chosen; depths are in metres in both. */
export const units = kept<Units>("units", "metric");

const NAUTICAL_MILE_M = 1852;

export function metres(value: number | null | undefined, digits = 1): string {
  return value == null ? UNKNOWN : `${fixed(value, digits)} m`;
}

/** A signed value with as many digits as its unit asks for. */
export function quantity(value: number, unit: string): string {
  const digits = unit === "m" ? 3 : unit === "m/s" ? 1 : 2;
  return `${value < 0 ? "-" : "+"}${fixed(Math.abs(value), digits)} ${unit}`;
}

export function percent(value: number | null | undefined, digits = 0): string {
  return value == null ? UNKNOWN : `${fixed(value, digits)} %`;
}

export function distance(value_m: number, digits = 0): string {
  if (value_m < 1000) return `${fixed(value_m, digits)} m`;
  return units.value === "nautical"
    ? `${fixed(value_m / NAUTICAL_MILE_M, 2)} nmi`
    : `${fixed(value_m / 1000, 2)} km`;
}

export function speed(value_mps: number): string {
  return units.value === "nautical"
    ? `${fixed((value_mps * 3600) / NAUTICAL_MILE_M, 1)} kn`
    : `${fixed(value_mps, 1)} m/s`;
}

/** A moment's day and time, where the page is; a day alone in UTC. */
export const dayAndTime = (date: Date): string =>
  date.toLocaleString(locale.value, { dateStyle: "medium", timeStyle: "short" });

/** The same in UTC, for what leaves the page. */
export const dayAndTimeUtc = (date: Date): string =>
  `${date.toLocaleString(locale.value, { dateStyle: "medium", timeStyle: "short", timeZone: "UTC" })} UTC`;

export const day = (date: Date): string =>
  date.toLocaleDateString(locale.value, { dateStyle: "medium", timeZone: "UTC" });

/** Of moments, newest first, those that begin another day than what is above them, which is now at first. */
export function daysOf(times: readonly string[], now: number): (string | null)[] {
  let above = new Date(now).toISOString().slice(0, 10);
  return times.map((time) => {
    const date = new Date(time);
    const changed = date.toISOString().slice(0, 10) !== above;
    above = date.toISOString().slice(0, 10);
    return changed ? day(date) : null;
  });
}

export function area(value_m2: number): string {
  return value_m2 < 1e6 ? `${count(Math.round(value_m2))} m²` : `${fixed(value_m2 / 1e6, 2)} km²`;
}

export function count(value: number): string {
  return value.toLocaleString("en", { useGrouping: true }).replaceAll(",", " ");
}

/** 7 s, 3 min 07 s, 2 h 05 min. */
export function duration(seconds: number | null | undefined): string {
  if (seconds == null) return UNKNOWN;
  const s = Math.max(0, Math.round(seconds));
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${pad(s % 60)} s`;
  return `${Math.floor(s / 3600)} h ${pad(Math.floor((s % 3600) / 60))} min`;
}

const COARSE_FROM_S = 600;

/** From least to most: 3 min 07 s to 4 min 10 s, from ten minutes on in whole ones: 13 to 21 min, 50 min to 1 h 05 min. */
export function durations(low_s: number, high_s: number): string {
  const coarse = high_s >= COARSE_FROM_S;
  const [low, high] = coarse ? [Math.floor(low_s / 60), Math.ceil(high_s / 60)] : [0, 0];
  if (coarse && low !== high && high < 60) return say("forecast.to", { low, high: `${high} min` });
  const [a, b] = coarse ? [minutes(60 * low), minutes(60 * high)] : [duration(low_s), duration(high_s)];
  return a === b ? a : say("forecast.to", { low: a, high: b });
}

/** Under a minute, 7 min, 2 h 05 min. */
export function minutes(seconds: number): string {
  return seconds < 60 ? "< 1 min" : seconds < 3600 ? `${Math.floor(seconds / 60)} min` : duration(seconds);
}

export function age(seconds: number | null): string {
  if (seconds === null) return say("format.never");
  return seconds < 10 ? `${fixed(seconds, 1)} s` : duration(seconds);
}

/** A direction as it is said: three whole digits, north is 000. */
export const direction = (degrees: number): string => String(Math.round(degrees) % 360).padStart(3, "0");

/** Coordinates with as many decimals as a step of the given size needs. */
export function latitude(degrees: number, decimals = 6): string {
  return `${Math.abs(degrees).toFixed(decimals)}° ${degrees < 0 ? "S" : "N"}`;
}

export function longitude(degrees: number, decimals = 6): string {
  return `${Math.abs(degrees).toFixed(decimals)}° ${degrees < 0 ? "W" : "E"}`;
}

export type CoordinateFormat = "decimal" | "minutes";

/** A place as charts and radios say it: decimal degrees, or degrees and decimal minutes. */
export function place([lng, lat]: readonly [number, number], format: CoordinateFormat): string {
  if (format === "decimal") return `${latitude(lat)} ${longitude(lng)}`;
  return `${arcMinutes(lat, 2)} ${lat < 0 ? "S" : "N"} ${arcMinutes(lng, 3)} ${lng < 0 ? "W" : "E"}`;
}

/** 41°11.1234′, rounded before it is split so that no 60 appears. */
function arcMinutes(degrees: number, width: number): string {
  const tenThousandths = Math.round(Math.abs(degrees) * 600_000);
  const whole = Math.floor(tenThousandths / 600_000);
  const rest = (tenThousandths % 600_000) / 10_000;
  return `${String(whole).padStart(width, "0")}°${rest.toFixed(4).padStart(7, "0")}′`;
}

export function clock(date: Date, zone: "utc" | "local"): string {
  return zone === "utc"
    ? date.toISOString().slice(11, 19)
    : date.toLocaleTimeString("en-GB", { hour12: false });
}

function pad(value: number): string {
  return String(value).padStart(2, "0");
}

export function megabytes(bytes: number): string {
  return `${fixed(bytes / 1e6, 1)} MB`;
}
