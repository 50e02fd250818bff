/** Places as they are typed and read. Pure. */

import { convert } from "geo-coordinates-parser";
import SPEC from "../api/mission.json";
import type { LngLat } from "../api/types";
import { say } from "../words/say";
import { isWithin } from "./form/missionFields";

export const placeSample = (): string => say("place.sample");

/** A place typed as decimal degrees, latitude first, or in another of the usual ways; null when it is none. */
export function placeOf(text: string): LngLat | null {
  const [lat = Number.NaN, lng = Number.NaN, ...rest] = text
    .trim()
    .split(/[,;\s]+/)
    .map((part) => (part ? Number(part) : Number.NaN));
  const found = rest.length > 0 || Number.isNaN(lat) || Number.isNaN(lng) ? converted(text) : [lng, lat];
  if (!found) return null;
  const [longitude, latitude] = found as LngLat;
  const isPlace =
    isWithin(latitude, SPEC["area.coordinates.1"]) && isWithin(longitude, SPEC["area.coordinates.0"]);
  return isPlace ? [longitude, latitude] : null;
}

function converted(text: string): LngLat | null {
  if ((text.match(/\d+(?:[.,]\d+)?/g)?.length ?? 0) < 2) return null;
  // Degrees and minutes are parted by hyphens in many messages.
  const parted = text.replace(/(\d)-(\d)/g, "$1 $2");
  try {
    const { decimalLongitude, decimalLatitude } = convert(parted, DIGITS);
    return [decimalLongitude, decimalLatitude];
  } catch {
    return null;
  }
}

/** A tenth of a millimetre. */
const DIGITS = 9;

/** A place as it is typed. */
export function typedPlace([lng, lat]: LngLat): string {
  return `${lat.toFixed(6)}, ${lng.toFixed(6)}`;
}
