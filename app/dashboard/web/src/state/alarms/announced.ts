/** What changed with the mission as a whole, as a screen reader tells it. */

import { computed } from "@preact/signals";
import { missionWords } from "../stateNames";
import { mission, socketStatus } from "../store";

export const missionAnnounced = computed(() => {
  const present = mission.value;
  return present && socketStatus.value?.kind === "open" ? `${present.name}: ${missionWords(present)}` : "";
});
