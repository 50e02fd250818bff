/** Numbers as an operator reads them. An en dash stands for "not known". */

const UNKNOWN = "–";

export function metres(value: number | null | undefined, digits = 1): string {
  return value == null ? UNKNOWN : `${value.toFixed(digits)} m`;
}

/** A signed value with as many digits as its unit asks for. */
export function quantity(value: number, unit: string): string {
  const digits = unit === "m" ? 3 : unit === "m/s" ? 1 : 2;
  return `${value < 0 ? "-" : "+"}${Math.abs(value).toFixed(digits)} ${unit}`;
}

export function percent(value: number | null | undefined, digits = 0): string {
  return value == null ? UNKNOWN : `${value.toFixed(digits)} %`;
}

export function distance(value_m: number, digits = 0): string {
  return value_m < 1000 ? `${value_m.toFixed(digits)} m` : `${(value_m / 1000).toFixed(2)} km`;
}

export function area(value_m2: number): string {
  return value_m2 < 1e6 ? `${count(Math.round(value_m2))} m²` : `${(value_m2 / 1e6).toFixed(2)} km²`;
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

/** Under a minute, 7 min, 2 h 05 min. */
export function minutes(seconds: number): string {
  return seconds < 60 ? "< 1 min" : seconds < 3600 ? `${Math.floor(seconds / 60)} min` : duration(seconds);
}

export function age(seconds: number | null): string {
  if (seconds === null) return "never";
  return seconds < 10 ? `${seconds.toFixed(1)} s` : duration(seconds);
}

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
  return `${(bytes / 1e6).toFixed(1)} MB`;
}
