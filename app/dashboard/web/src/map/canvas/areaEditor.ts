/** Drawing on the map, and dragging corners, with terra-draw, which is fetched when it is first needed. */

import type { Map as MapLibreMap } from "maplibre-gl";
import type { TerraDraw } from "terra-draw";
import type { TerraDrawMapLibreGLAdapter } from "terra-draw-maplibre-gl-adapter";
import type { LngLat } from "../../api/types";
import type { Chart } from "./chart";
import type { Sketch } from "./movingMarks";

type Changes = Parameters<TerraDrawMapLibreGLAdapter<MapLibreMap>["render"]>[0];
type Modes = ConstructorParameters<typeof TerraDraw>[0]["modes"];

const DIGITS = 9;

/** Lets one shape be drawn; returns what ends that. */
export async function draw(
  chart: Chart,
  shape: "polygon" | "rectangle",
  onDrawn: (ring: LngLat[]) => void,
): Promise<() => void> {
  const { TerraDrawPolygonMode, TerraDrawRectangleMode } = await import("terra-draw");
  const { terra, end } = await begin(chart, [new TerraDrawPolygonMode(), new TerraDrawRectangleMode()]);
  terra.setMode(shape);
  terra.on("finish", () => {
    const ring = ringOfShape(terra);
    // The library is still at work on what it just finished.
    queueMicrotask(() => {
      end();
      onDrawn(ring);
    });
  });
  return end;
}

/** Lets the corners of a ring be dragged, added and taken away; returns what ends that. */
export async function edit(
  chart: Chart,
  ring: readonly LngLat[],
  onChanged: (ring: LngLat[]) => void,
): Promise<() => void> {
  const { TerraDrawPolygonMode, TerraDrawSelectMode } = await import("terra-draw");
  const corners = { draggable: true, deletable: true, midpoints: { draggable: true } };
  const select = new TerraDrawSelectMode({ flags: { polygon: { feature: { coordinates: corners } } } });
  const { terra, end } = await begin(chart, [new TerraDrawPolygonMode(), select]);
  const rounded = ring.map(([lng, lat]) => [Number(lng.toFixed(DIGITS)), Number(lat.toFixed(DIGITS))]);
  const [added] = terra.addFeatures([
    {
      type: "Feature",
      geometry: { type: "Polygon", coordinates: [[...rounded, rounded[0] as number[]]] },
      properties: { mode: "polygon" },
    },
  ]);
  // What cannot be taken, as an outline that crosses itself, is not dragged but drawn anew.
  if (!added?.valid || added.id === undefined) {
    end();
    return end;
  }
  terra.setMode("select");
  terra.selectFeature(added.id);
  let told = JSON.stringify(rounded);
  const tell = () => {
    const now = ringOfShape(terra);
    const text = JSON.stringify(now);
    if (now.length < 3 || text === told) return;
    told = text;
    onChanged(now);
  };
  let frame = 0;
  // While a corner is dragged, too: what follows from the area is drawn anew meanwhile.
  terra.on("change", () => {
    cancelAnimationFrame(frame);
    frame = requestAnimationFrame(tell);
  });
  terra.on("finish", tell);
  return () => {
    cancelAnimationFrame(frame);
    end();
  };
}

async function begin(chart: Chart, modes: Modes) {
  const [{ TerraDraw }, { TerraDrawMapLibreGLAdapter }] = await Promise.all([
    import("terra-draw"),
    import("terra-draw-maplibre-gl-adapter"),
  ]);
  /** Takes the map's events, and shows what is being drawn on the map's own sheet. */
  class SketchAdapter extends TerraDrawMapLibreGLAdapter<MapLibreMap> {
    override render({ created, updated, unchanged }: Changes): void {
      chart.setSketch(sketchOf([...created, ...updated, ...unchanged]));
    }

    override clear(): void {
      chart.setSketch(null);
    }
  }
  const terra = new TerraDraw({
    adapter: new SketchAdapter({ map: chart.map, coordinatePrecision: DIGITS }),
    modes,
  });
  terra.start();
  chart.map.doubleClickZoom.disable();
  let over = false;
  const end = () => {
    if (over) return;
    over = true;
    terra.stop();
    chart.setSketch(null);
    chart.map.doubleClickZoom.enable();
  };
  return { terra, end };
}

function sketchOf(features: Changes["created"]): Sketch {
  const lines: LngLat[][] = [];
  const handles: { at: LngLat; strong: boolean }[] = [];
  for (const { geometry, properties } of features) {
    if (geometry.type === "Polygon") lines.push((geometry.coordinates as LngLat[][])[0] ?? []);
    else if (geometry.type === "LineString") lines.push(geometry.coordinates as LngLat[]);
    else handles.push({ at: geometry.coordinates as LngLat, strong: !properties.midPoint });
  }
  return { lines, handles };
}

function ringOfShape(terra: TerraDraw): LngLat[] {
  const found = terra.getSnapshot().find((one) => one.geometry.type === "Polygon");
  const ring = (found?.geometry.coordinates as LngLat[][] | undefined)?.[0] ?? [];
  return ring.slice(0, -1).map(([lng, lat]): LngLat => [lng, lat]);
}
