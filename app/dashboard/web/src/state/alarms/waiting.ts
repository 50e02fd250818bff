/** Whether the vehicles wait for the next step's decision, and for how long. */

import { computed, effect, signal } from "@preact/signals";
import { allDecided, allWait } from "../live";
import { mission, now, socketStatus, vehicles } from "../store";

/** A decision that takes no longer is not worth a word. */
const LEAST_S = 2;

const idle = computed(() => {
  const present = mission.value;
  if (present?.state !== "running" || socketStatus.value?.kind !== "open") return false;
  if (allDecided(present.progress)) return false;
  return allWait(vehicles.value);
});

const since = signal<number | null>(null);
effect(() => {
  since.value = idle.value ? Date.now() : null;
});

/** Seconds; null while vehicles are under way. */
export const decidingFor = computed(() => {
  const began = since.value;
  if (began === null) return null;
  const seconds = (now.value - began) / 1000;
  return seconds >= LEAST_S ? seconds : null;
});
