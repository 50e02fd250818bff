/** What a mission did, step by step: series for charts, and where the vehicles were at a step. Pure. */

import type { LngLat, StepView, TimedTracks } from "../../api/types";
import { wayBetween } from "../../map/geo";
import { type Key, say } from "../../words/say";
import { SETTLED } from "../live";

export interface Series {
  label: string;
  values: (number | null)[];
}

/** Figures over the steps: what of them is there at all, in percent and otherwise. */
export function figuresOf(steps: readonly StepView[]) {
  const figure = (name: string) => steps.map((s) => s.figures[name] ?? null);
  return {
    numbers: steps.map((s) => s.number),
    coverage: figure("coverage_pct"),
    remaining: figure("remaining_pct"),
    deviation: figure("mean_sd_m"),
    soundings: steps.map((s) => s.soundings),
    objective: steps.map((s) => s.objective),
    terms: termsOf(steps),
  };
}

type Term = Extract<Key, `terms.${string}`>;

const TERMS: Readonly<Record<string, Exclude<Term, "terms.trustInPrediction">>> = {
  feasible: "terms.feasible",
  finish: "terms.finish",
  left_m: "terms.left_m",
  left_pct: "terms.left_pct",
  waypoints: "terms.waypoints",
  errands: "terms.errands",
};

/** Steps with others, each once as it was told last, in their order. */
export function withSteps(known: readonly StepView[], told: readonly StepView[]): StepView[] {
  const byNumber = new Map([...known, ...told].map((step) => [step.number, step]));
  return [...byNumber.values()].sort((a, b) => a.number - b.number);
}

/** The last step up to which nothing is to be flown any more; 0: none. */
export function lastFlown(known: readonly StepView[]): number {
  const ahead = known.findIndex(({ waypoints }) => waypoints.some(({ status }) => !SETTLED.includes(status)));
  return (ahead < 0 ? known.at(-1)?.number : known[ahead - 1]?.number) ?? 0;
}

/** A planner's figure in words. */
export function termWords(name: string): string {
  const theta = /^theta_(\d+)$/.exec(name);
  if (theta) return say("terms.trustInPrediction", { number: Number(theta[1]) + 1 });
  const term = TERMS[name];
  return term ? say(term) : name.replaceAll("_", " ");
}

function termsOf(steps: readonly StepView[]): Series[] {
  const names = [...new Set(steps.flatMap((s) => Object.keys(s.terms)))];
  return names
    .slice(0, 8)
    .map((name) => ({ label: termWords(name), values: steps.map((s) => s.terms[name] ?? null) }));
}

/** A vehicle's whole way with its depths. */
export interface Way {
  places: readonly LngLat[];
  depths_m: readonly number[];
}

export function waysOf(tracks: TimedTracks): Record<string, Way> {
  return Object.fromEntries(
    tracks.features.map(({ properties, geometry }) => [
      properties.vehicle,
      { places: geometry.coordinates, depths_m: properties.depths_m },
    ]),
  );
}

/**
 * For every step, how many places of a vehicle's way lie before its end. The vehicle's clock and the service's need not
 * agree, so the way is followed from waypoint to waypoint that it reached.
 */
export function endsOf(vehicle: string, way: Way, steps: readonly StepView[]): number[] {
  let end = 0;
  return steps.map((step) => {
    const waypoint = step.waypoints.find((w) => w.vehicle === vehicle);
    if (waypoint?.status === "reached") {
      const target: LngLat = [waypoint.lon_deg, waypoint.lat_deg];
      const near = way.places.findIndex(
        (place, i) => i >= end && wayBetween(place, target).metres <= waypoint.arrival_radius_m + 1,
      );
      if (near >= 0) end = near + 1;
    }
    return end;
  });
}

/** Where a vehicle was at a step: the last place before its end, else where the step sent it. */
export function placeAt(
  vehicle: string,
  way: Way | undefined,
  ends: readonly number[],
  index: number,
  step: StepView,
) {
  const end = ends[index] ?? 0;
  const place = way?.places[end - 1];
  const waypoint = step.waypoints.find((w) => w.vehicle === vehicle);
  if (place) return { place, depth_m: way?.depths_m[end - 1] ?? null, waypoint };
  return waypoint
    ? { place: [waypoint.lon_deg, waypoint.lat_deg] as LngLat, depth_m: waypoint.depth_m, waypoint }
    : null;
}
