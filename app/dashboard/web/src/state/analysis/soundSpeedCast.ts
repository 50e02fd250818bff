/** Sound speed casts as files have them: a profile, and of which formats it is known when and where it was taken. Pure. */

import { type Profile, profileOf } from "./soundSpeedProfile";

export interface Cast {
  profile: Profile;
  /** ISO 8601, UTC; null: the file does not say. */
  time: string | null;
  /** Longitude and latitude; null: the file does not say. */
  position: [lon_deg: number, lat_deg: number] | null;
}

type Head = Pick<Cast, "time" | "position">;

/** Kongsberg: "( SoundVelocity 1.0 0 202611301100 41.1 -8.7 …", with seconds in some. */
const ASVP = /\(\s*SoundVelocity\s+\S+\s+\S+\s+(\d{4})(\d\d)(\d\d)(\d\d)(\d\d)(\d\d)?\s+(\S+)\s+(\S+)/i;
/** CARIS: "Section 2026-334 11:00:00 41:11:00N -8:42:00", day of the year, degrees also with decimals. */
const SECTION =
  /^\s*Section,?\s+(\d{4})-(\d{1,3}),?\s+(\d{1,2}):(\d\d):(\d\d)(?:[,\s]+([^,\s]+)[,\s]+([^,\s]+))?/i;
/** HYPACK: "FTP NEW 3 41.1 -8.7 11:00 11/30/2026". */
const VEL = /^\s*FTP\s+NEW\s+3\s+(\S+)\s+(\S+)\s+(\d\d):(\d\d)\s+(\d\d)\/(\d\d)\/(\d{4})/i;
const ISO = /(\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d)(?::(\d\d))?(?:\.\d+)?\s*(Z|UTC|[+-]\d\d:?\d\d)?/i;
const LATITUDE = /\blat(?:itude)?\b[^\d+-]*([+-]?\d+\.\d+)\s*°?\s*([NS]?)\s*(?:$|[,;\t])/i;
const LONGITUDE = /\blon(?:g|gitude)?\b[^\d+-]*([+-]?\d+\.\d+)\s*°?\s*([EW]?)\s*(?:$|[,;\t])/i;

/** The casts of a file: all sections of one by CARIS, else one. Without a profile none. */
export function castsOf(text: string): Cast[] {
  const lines = text.split(/\r?\n/);
  const starts = lines.flatMap((line, at) => (SECTION.test(line) ? [at] : []));
  const parts = starts.length ? starts.map((from, i) => lines.slice(from, starts[i + 1]).join("\n")) : [text];
  return parts
    .map((part) => ({ profile: profileOf(part), ...headOf(part) }))
    .filter(({ profile }) => profile.length > 0);
}

/** What a file's heading says of time and place. */
function headOf(text: string): Head {
  const asvp = ASVP.exec(text);
  if (asvp) {
    const [, year, month, day, hour, minute, second = "00", lat = "", lon = ""] = asvp;
    return {
      time: moment(`${year}-${month}-${day}T${hour}:${minute}:${second}Z`),
      position: place(lat, lon),
    };
  }
  const vel = VEL.exec(text);
  if (vel) {
    const [, lat = "", lon = "", hour, minute, month, day, year] = vel;
    return { time: moment(`${year}-${month}-${day}T${hour}:${minute}:00Z`), position: place(lat, lon) };
  }
  const section = SECTION.exec(text);
  if (section) {
    const [, year, day, hour, minute, second, lat = "", lon = ""] = section;
    const at = new Date(Date.UTC(Number(year), 0, Number(day), Number(hour), Number(minute), Number(second)));
    const isDay = at.getUTCFullYear() === Number(year);
    return { time: isDay ? moment(at.toISOString()) : null, position: place(lat, lon) };
  }
  return labelled(text);
}

/** Time and place that headings of tables name: a time as ISO 8601, latitude and longitude in degrees with decimals. */
function labelled(text: string): Head {
  const lines = text.split(/\r?\n/).slice(0, 100);
  const signed = (pattern: RegExp) => (line: string) => {
    const found = pattern.exec(line);
    if (!found) return null;
    const degrees = Number(found[1]);
    return /[SW]/i.test(found[2] ?? "") ? -Math.abs(degrees) : degrees;
  };
  const lat_deg = firstOf(lines, signed(LATITUDE));
  const lon_deg = firstOf(lines, signed(LONGITUDE));
  return {
    time: firstOf(lines, timeOf),
    position: lat_deg === null || lon_deg === null ? null : known(lat_deg, lon_deg),
  };
}

/** What is read of the first line that has it. */
function firstOf<T>(lines: readonly string[], read: (line: string) => T | null): T | null {
  for (const line of lines) {
    const found = read(line);
    if (found !== null) return found;
  }
  return null;
}

/** A time in a text, UTC where it names no zone; null: there is none. */
export function timeOf(text: string): string | null {
  const found = ISO.exec(text);
  if (!found) return null;
  const [, year, month, day, hour, minute, second = "00", zone = "Z"] = found;
  const offset = /^(Z|UTC)$/i.test(zone) ? "Z" : zone.replace(/(\d\d):?(\d\d)$/, "$1:$2");
  return moment(`${year}-${month}-${day}T${hour}:${minute}:${second}${offset}`);
}

/** The moment of an ISO 8601 time with its zone; null where there is no such day, which programs count on from. */
function moment(iso: string): string | null {
  const day = iso.slice(0, 10);
  const isDay = !Number.isNaN(Date.parse(day)) && new Date(day).toISOString().startsWith(day);
  return isDay && !Number.isNaN(Date.parse(iso)) ? new Date(iso).toISOString() : null;
}

/** Degrees with decimals or as 41:11:00N; null: neither. */
function degreesOf(text: string): number | null {
  const found = /^([+-]?)(\d+(?:\.\d+)?)(?::(\d+(?:\.\d+)?))?(?::(\d+(?:\.\d+)?))?([NSEW]?)$/i.exec(text);
  if (!found) return null;
  const [, sign, degrees, minutes = 0, seconds = 0, side = ""] = found;
  const size = Number(degrees) + Number(minutes) / 60 + Number(seconds) / 3600;
  return sign === "-" || /[SW]/i.test(side) ? -size : size;
}

function place(lat: string, lon: string): Cast["position"] {
  const [lat_deg, lon_deg] = [degreesOf(lat), degreesOf(lon)];
  return lat_deg === null || lon_deg === null ? null : known(lat_deg, lon_deg);
}

/** Where nobody knew the place, programs write zeros. */
const known = (lat_deg: number, lon_deg: number): Cast["position"] =>
  Math.abs(lat_deg) > 90 || Math.abs(lon_deg) > 180 || (lat_deg === 0 && lon_deg === 0)
    ? null
    : [lon_deg, lat_deg];

/** A profile as it is typed: depth and speed on each line. */
export const written = (profile: Readonly<Profile>): string =>
  profile.map(([depth_m, speed_mps]) => `${depth_m} ${speed_mps}`).join("\n");
