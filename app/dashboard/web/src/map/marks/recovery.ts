/** Where vehicles come home to, as places on the map. Pure. */

import { say } from "../../words/say";
import type { Circle, PlaceMark, Track } from "./marks";

type At = readonly [number, number];

interface Homes {
  recovery?: { point: At; radius_m: number } | null;
  vehicles: readonly { name: string; recovery_point?: At | null }[];
}

/** The mission's recovery point and those of single vehicles; `usual_m` is the radius where the mission has none. */
export function recoveryMarks({ recovery, vehicles }: Homes, usual_m: number): PlaceMark[] {
  const mark = (words: string, [lng, lat]: At): PlaceMark => ({
    words,
    sign: "home",
    at: [lng, lat],
    radius_m: recovery?.radius_m ?? usual_m,
  });
  return [
    ...(recovery ? [mark(say("mission.recovery"), recovery.point)] : []),
    ...vehicles.flatMap(({ name, recovery_point: own }) =>
      own ? [mark(say("recovery.recoveryOf", { name }), own)] : [],
    ),
  ];
}

interface Homeward {
  active: boolean;
  lon_deg: number | null;
  lat_deg: number | null;
  way_home: readonly At[];
}

interface Waiting {
  active: boolean;
  waiting_circle: { centre: At; radius_m: number } | null;
}

/** The circle in which a vehicle was sent to wait; nothing where it was not. */
export function waitingCircle({ active, waiting_circle: circle }: Waiting, colour: string): Circle[] {
  if (!active || !circle) return [];
  return [{ at: [circle.centre[0], circle.centre[1]], radius_m: circle.radius_m, colour }];
}

/** A vehicle's way home as a line from where it is; nothing where there is none, or it is there. */
export function wayHome({ active, lon_deg, lat_deg, way_home }: Homeward, colour: string): Track[] {
  if (!active || lon_deg === null || lat_deg === null || way_home.length === 0) return [];
  return [{ points: [[lon_deg, lat_deg], ...way_home.map(([lng, lat]): At => [lng, lat])], colour }];
}
