/** What is drawn on the map: lines of vehicles, and soundings under review. */

import type { LngLat, Place } from "../api/types";

/** Line on the map: a vehicle's track or its route to a waypoint. */
export interface Track {
  points: readonly Place[];
  colour: string;
}

export interface Route extends Track {
  /** Only what the vehicle acknowledged is its route; anything before is drawn as a mere wish. */
  acknowledged: boolean;
  arrivalRadius_m: number;
}

export interface Spot {
  id: number;
  at: LngLat;
  state: string;
  chosen: boolean;
}
