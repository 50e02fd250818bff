/** How well a vehicle knows where it is, and its risings for a fix, in words. */

import type { PositionQuality, VehicleView } from "../api/types";

const WORDS: Record<PositionQuality, string> = {
  untold: "",
  stated: "",
  good: "good",
  fading: "fading",
  poor: "▲ worse than allowed",
};

export function localizationWords(vehicle: VehicleView): string[] {
  const { position_sd_m: sd, localization, surfacing, risings } = vehicle;
  const quality = WORDS[localization];
  return [
    ...(sd === null ? [] : [`nav ± ${sd.toFixed(1)} m${quality ? `, ${quality}` : ""}`]),
    ...(surfacing ? ["up for a GPS fix"] : []),
    ...(risings > 0 ? [`${risings} ${risings === 1 ? "rising" : "risings"}`] : []),
  ];
}
