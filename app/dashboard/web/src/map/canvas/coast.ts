/**
 * The world's coasts, 1 : 50 million (Natural Earth, by way of world-atlas). They tell where on earth the map is, not where
 * the shore lies: they are gone long before they could be taken for that. Fetched from the service when first wanted.
 */

import type { MultiPolygon, Polygon } from "geojson";
import { feature } from "topojson-client";
import type { GeometryCollection, Topology } from "topojson-specification";
import address from "world-atlas/land-50m.json?url";
import type { LngLat } from "../../api/types";
import { fetchedOnce } from "../fetchedOnce";
import { type Bounds, boundsOf } from "../geo";
import type { Paper } from "./mapColours";
import type { Projection } from "./projection";
import { stroke, trace } from "./shapes";

/** From this zoom on a coast would be off by more than is seen. */
const GONE_ZOOM = 11;

export interface Land {
  rings: readonly (readonly LngLat[])[];
  bounds: Bounds;
}

export const showsCoast = (zoom: number): boolean => zoom < GONE_ZOOM;

/** Asks for the coasts. */
export const coasts = fetchedOnce(
  address,
  async (answer): Promise<readonly Land[]> =>
    landsOf((await answer.json()) as Topology<{ land: GeometryCollection }>),
);

function landsOf(world: Topology<{ land: GeometryCollection }>): Land[] {
  return feature(world, world.objects.land).features.flatMap(({ geometry }) => {
    const { type, coordinates } = geometry as Polygon | MultiPolygon;
    const polygons = (type === "Polygon" ? [coordinates] : coordinates) as LngLat[][][];
    return polygons.flatMap((rings) => {
      const bounds = boundsOf(rings[0] ?? []);
      return bounds ? [{ rings, bounds }] : [];
    });
  });
}

export function paintCoasts(
  context: CanvasRenderingContext2D,
  at: Projection,
  lands: readonly Land[],
  paper: Paper,
): void {
  const [west, north] = at.place(0, 0);
  const [east, south] = at.place(at.width, at.height);
  context.beginPath();
  for (const { rings, bounds } of lands) {
    if (bounds[0] > east || bounds[2] < west || bounds[1] > north || bounds[3] < south) continue;
    for (const ring of rings) trace(context, at, ring, true);
  }
  context.fillStyle = paper.land;
  context.fill("evenodd");
  stroke(context, { colour: paper.shore, width: 1 });
}
