/** What is drawn on the map: lines of vehicles, places with a name, and soundings under review. */

import type { LngLat, Place } from "../../api/types";

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

/** A circle of a vehicle's on the map. */
export interface Circle {
  at: LngLat;
  radius_m: number;
  colour: string;
}

/** A place with a name; with a radius, what is about it. */
export interface PlaceMark {
  words: string;
  sign: "goal" | "entry" | "transmitter" | "home" | "position" | "own" | "block";
  at: LngLat;
  radius_m: number;
  /** Which way it points, degrees from north. */
  bow_deg?: number;
  /** It may be elsewhere by now. */
  old?: boolean;
}
