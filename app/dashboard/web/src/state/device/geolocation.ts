/** Where this device is, as its browser tells. */

import { effect, signal } from "@preact/signals";
import type { LngLat } from "../../api/types";
import { say } from "../../words/say";
import { destination } from "../store";

export interface OwnPosition {
  at: LngLat;
  accuracy_m: number;
}

/** Whether this device's position is followed. */
export const followOwn = signal(false);
export const ownPosition = signal<OwnPosition | null>(null);
/** Why there is none; empty while all is well. */
export const ownFault = signal("");

/** Why a browser may not tell at all; empty where it may. */
export function whyNoPosition(): string {
  if (!isSecureContext) return say("own.browsersTellPositionsOnlyTo");
  return "geolocation" in navigator ? "" : say("own.thisBrowserTellsNoPosition");
}

const REASONS: Readonly<Record<number, string>> = {
  get 1() {
    return say("own.allowThisPageToKnowYour");
  },
  get 2() {
    return say("own.thisDeviceDoesNotKnowWhere");
  },
  get 3() {
    return say("own.thisDeviceHasNotFoundIts");
  },
};
/** As much about the position as is shown when it is first known, degrees. */
const ABOUT = 0.002;

effect(() => {
  ownPosition.value = null;
  ownFault.value = "";
  if (!followOwn.value) return;
  let first = true;
  const watch = navigator.geolocation.watchPosition(
    ({ coords }) => {
      const { longitude: lng, latitude: lat } = coords;
      ownFault.value = "";
      ownPosition.value = { at: [lng, lat], accuracy_m: coords.accuracy };
      if (first) destination.value = [lng - ABOUT, lat - ABOUT, lng + ABOUT, lat + ABOUT];
      first = false;
    },
    ({ code, message }) => {
      ownFault.value = REASONS[code] ?? message;
    },
    { enableHighAccuracy: true },
  );
  return () => navigator.geolocation.clearWatch(watch);
});
