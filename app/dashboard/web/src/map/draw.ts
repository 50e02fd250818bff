/** Drawing on the map with terra-draw, which is fetched when it is first needed. */

import type { LngLat } from "../api/types";
import type { Chart } from "./chart";

/** Lets one shape be drawn; returns what ends that. */
export async function draw(
  chart: Chart,
  shape: "polygon" | "rectangle",
  onChange: (corners: LngLat[]) => void,
  onDrawn: (ring: LngLat[]) => void,
): Promise<() => void> {
  const [{ TerraDraw, TerraDrawPolygonMode, TerraDrawRectangleMode }, { TerraDrawMapLibreGLAdapter }] =
    await Promise.all([import("terra-draw"), import("terra-draw-maplibre-gl-adapter")]);
  const styles = {
    fillColor: "#1d5c94",
    fillOpacity: 0.18,
    outlineColor: "#1d5c94",
    outlineWidth: 3,
  } as const;
  const terra = new TerraDraw({
    adapter: new TerraDrawMapLibreGLAdapter({ map: chart.map, coordinatePrecision: 9 }),
    modes: [new TerraDrawPolygonMode({ styles }), new TerraDrawRectangleMode({ styles })],
  });
  terra.start();
  terra.setMode(shape);
  let over = false;
  const end = () => {
    if (over) return;
    over = true;
    terra.stop();
    chart.map.doubleClickZoom.enable();
  };
  const ringOfShape = (): LngLat[] => {
    const found = terra.getSnapshot().find((one) => one.geometry.type === "Polygon");
    const ring = (found?.geometry.coordinates as LngLat[][] | undefined)?.[0] ?? [];
    return ring.slice(0, -1).map(([lng, lat]): LngLat => [lng, lat]);
  };
  chart.map.doubleClickZoom.disable();
  terra.on("change", () => onChange(ringOfShape()));
  terra.on("finish", () => {
    const ring = ringOfShape();
    // The library is still at work on what it just finished.
    queueMicrotask(() => {
      end();
      onDrawn(ring);
    });
  });
  return end;
}
