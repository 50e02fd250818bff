/** Charts under the map, where the service has any: a tile server, or one file of raster tiles that it hands out. */

import { signal } from "@preact/signals";

/** An address with {z}, {x} and {y}, `pmtiles://…`, or empty for none. */
export const tilesAddress = signal("");

/** Asks the service once; without an answer there are no charts, which everything works without. */
export async function findCharts(): Promise<void> {
  try {
    const { tiles } = (await (await fetch("/charts.json")).json()) as { tiles: string };
    if (tiles.startsWith("pmtiles://")) {
      const [{ Protocol }, { addProtocol }] = await Promise.all([import("pmtiles"), import("maplibre-gl")]);
      addProtocol("pmtiles", new Protocol().tile);
      tilesAddress.value = tiles.replace("pmtiles://", `pmtiles://${location.origin}`);
    } else {
      tilesAddress.value = tiles;
    }
  } catch {
    tilesAddress.value = "";
  }
}
