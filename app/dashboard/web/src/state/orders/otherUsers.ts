/** What other watch-keepers commanded, so that nobody is surprised by what the vehicles do. Pure but for its signals. */

import { computed, effect, signal } from "@preact/signals";
import type { EventView } from "../../api/types";
import { say } from "../../words/say";
import { me } from "../access";
import { now, selectedId, view } from "../store";

/** The last command of somebody else in these lines of the log that came after `after`; undefined where there is none. */
export function commandOfOthers(
  events: readonly EventView[],
  after: number,
  mine: string,
): EventView | undefined {
  return events.findLast(({ id, data }) => {
    const { actor } = data;
    return id > after && typeof actor === "string" && actor !== "" && actor !== mine;
  });
}

/** A command in words: who did what. */
export function commandWords({ kind, message, data }: Pick<EventView, "kind" | "message" | "data">): string {
  const actor = String(data.actor);
  if (kind === "state") {
    if (data.state === "running") return say("others.started", { actor });
    if (data.state === "paused") return say("others.paused", { actor });
    if (data.state === "finished") return say("others.finished", { actor });
    if (data.state === "aborted") return say("others.aborted", { actor });
  }
  return say("others.did", { actor, message });
}

const SHOWN_MS = 15_000;

const newest = computed(() =>
  commandOfOthers(view.value.events, view.value.lastEventId, me.value?.name ?? ""),
);
const heard = signal<{ id: number; at: number } | null>(null);

effect(() => {
  selectedId.value;
  heard.value = null;
});
effect(() => {
  const { id } = newest.value ?? {};
  if (id !== undefined && id !== heard.peek()?.id) heard.value = { id, at: Date.now() };
});

/** What somebody else just commanded; empty when nobody did for a while. */
export const othersWords = computed(() => {
  const command = newest.value;
  const since = heard.value;
  if (!command || since?.id !== command.id || now.value - since.at > SHOWN_MS) return "";
  return commandWords(command);
});
