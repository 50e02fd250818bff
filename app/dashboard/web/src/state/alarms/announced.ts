/** What changed with the mission as a whole and with the link to the service, as a screen reader tells it. */

import { computed, effect, signal } from "@preact/signals";
import { say } from "../../words/say";
import { missionWords } from "../stateNames";
import { live, mission, socketStatus } from "../store";

export const missionAnnounced = computed(() => {
  const present = mission.value;
  return present && socketStatus.value?.kind === "open" ? `${present.name}: ${missionWords(present)}` : "";
});

const WAITING = {
  gone: "topBar.serviceGone",
  missing: "topBar.noSuchMission",
  crowded: "topBar.crowded",
} as const;

/** How the link stands, without what counts on, and as before while it is tried again: that would be told each time. */
export const linkAnnounced = signal("");
effect(() => {
  const status = socketStatus.value;
  if (!status) linkAnnounced.value = "";
  else if (status.kind === "open")
    linkAnnounced.value = say(mission.value && !live.value ? "topBar.silent" : "topBar.live");
  else if (status.kind === "waiting") linkAnnounced.value = say(WAITING[status.why ?? "gone"]);
  else if (status.kind === "refused") linkAnnounced.value = say("topBar.notSignedIn");
});
