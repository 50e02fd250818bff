/** Charts under the map, where this device has any: an address of raster tiles or a PMTiles file of the service. */

import { kept } from "../kept";

/** `https://…/{z}/{x}/{y}.png`, `pmtiles://…`, or empty for none. */
export const tilesAddress = kept("tiles", "");
