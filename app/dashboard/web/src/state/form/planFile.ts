/** A plan's ways as files for chart programs and GIS: GeoJSON, and GPX with a route for each vehicle. Pure. */

import type { LngLat, PlanView } from "../../api/types";
import { plainFileName } from "./missionFile";

/** The plan of a block with its name; "" where it is the only one. */
export interface NamedPlan {
  block: string;
  plan: Pick<PlanView, "vehicles">;
}

interface NamedWay {
  vehicle: string;
  block: string;
  way: readonly LngLat[];
}

/** A vehicle that has nowhere to go has no line. */
const waysOf = (plans: readonly NamedPlan[]): NamedWay[] =>
  plans.flatMap(({ block, plan }) =>
    plan.vehicles
      .map(({ vehicle, way }) => ({ vehicle, block, way: way as readonly LngLat[] }))
      .filter(({ way }) => way.length > 1),
  );

export const planFileName = (mission: string, ending: string): string =>
  `${plainFileName(mission)}.plan.${ending}`;

export function planGeoJson(plans: readonly NamedPlan[]): string {
  const features = waysOf(plans).map(({ vehicle, block, way }) => ({
    type: "Feature",
    properties: { vehicle, ...(block ? { block } : {}) },
    geometry: { type: "LineString", coordinates: way },
  }));
  return `${JSON.stringify({ type: "FeatureCollection", features }, null, 2)}\n`;
}

export function planGpx(plans: readonly NamedPlan[]): string {
  const routes = waysOf(plans).map(({ vehicle, block, way }) => {
    const name = escaped(block ? `${vehicle}, ${block}` : vehicle);
    const points = way.map(([lng, lat]) => `    <rtept lat="${lat}" lon="${lng}"/>`);
    return ["  <rte>", `    <name>${name}</name>`, ...points, "  </rte>"].join("\n");
  });
  return [
    '<?xml version="1.0" encoding="UTF-8"?>',
    '<gpx version="1.1" creator="bathyfleet" xmlns="http://www.topografix.com/GPX/1/1">',
    ...routes,
    "</gpx>\n",
  ].join("\n");
}

const escaped = (text: string): string =>
  text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
