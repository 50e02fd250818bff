/** How deep the water is where a vehicle is. Pure. */

import type { VehicleView } from "../api/types";

type Heights = Pick<VehicleView, "depth_m" | "altitude_m">;

/** The vehicle's depth and its altitude above the bottom together; null where either is not known, or they are old. */
export const waterDepth_m = ({ depth_m, altitude_m }: Heights, fresh: boolean): number | null =>
  !fresh || depth_m === null || altitude_m === null ? null : depth_m + altitude_m;
