/** Where whoever recovers vehicles is, and how far and which way it is to each from there. */

import type { LngLat, OwnShipView, VehicleView } from "../api/types";
import { wayBetween } from "../map/geo";
import { direction, distance } from "./format";

type Ship = Pick<OwnShipView, "lat_deg" | "lon_deg" | "current">;

/** The own ship's place while it is told, else this device's; null: neither is known now. */
export function ownPlace(ship: Ship | null, told: boolean, device: { at: LngLat } | null): LngLat | null {
  if (ship?.current && told) return [ship.lon_deg, ship.lat_deg];
  return device?.at ?? null;
}

/** From a place to where a vehicle was last: "1.20 km, 074°", true; null where either is not known. */
export function wayTo(
  { lat_deg, lon_deg }: Pick<VehicleView, "lat_deg" | "lon_deg">,
  from: LngLat | null,
): string | null {
  if (from === null || lat_deg === null || lon_deg === null) return null;
  const { metres, bearing_deg } = wayBetween(from, [lon_deg, lat_deg]);
  return `${distance(metres)}, ${direction(bearing_deg)}°`;
}
