/** How well a vehicle knows where it is, and its risings for a fix, in words. */

import type { PositionQuality, VehicleView } from "../api/types";
import { say } from "../words/say";
import { fixed } from "./format";

const WORDS: Record<PositionQuality, string> = {
  untold: "",
  stated: "",
  get good() {
    return say("localization.good");
  },
  get fading() {
    return say("localization.fading");
  },
  get poor() {
    return say("localization.worseThanAllowed");
  },
};

export function localizationWords(vehicle: VehicleView): string[] {
  const { position_sd_m: sd, localization, surfacing, risings } = vehicle;
  const quality = WORDS[localization];
  return [
    ...(sd === null
      ? []
      : [say("localization.navM", { sd: fixed(sd, 1), it: quality ? `, ${quality}` : "" })]),
    ...(surfacing ? [say("localization.upForAGpsFix")] : []),
    ...(risings > 0 ? [`${risings} ${risings === 1 ? "rising" : "risings"}`] : []),
  ];
}
