import "./Tour.css";
import { signal, useSignalEffect } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { kept } from "../persistentSignal";
import { emptyDraft, toMission } from "../state/form/draft";
import { createMission } from "../state/session";
import {
  layer,
  mapCentre,
  measured,
  mission,
  now,
  preflightOpen,
  seaFloor,
  selectedId,
  tab,
} from "../state/store";
import { stepAfter, TOUR } from "../state/tour";
import { say } from "../words/say";
import { Button } from "./parts/Controls";

/** Where the guided mission stands on this device; null: nobody is guided. */
const tour = kept<{ mission: string; step: number; held: boolean } | null>("tour", null);

/** Long enough for all of it, short enough to be seen to its end. */
const STEPS = "60";

/** Begins with a mission of two simulated vehicles where the map is. Throws what the service refused. */
export async function beginTour(): Promise<void> {
  const draft = { ...emptyDraft(mapCentre.value), name: say("tour.missionName"), steps: STEPS };
  const id = await createMission(toMission(draft));
  tour.value = { mission: id, step: 0, held: false };
}

/** The element that is marked as the next to press. */
const marked = signal<Element | null>(null);

/** What to do next of the guided first mission, beside the map; the rest of the page stays as it is. */
export function Tour() {
  useSignalEffect(() => {
    const stands = tour.value;
    const present = mission.value;
    if (!stands || present?.id !== stands.mission) return;
    const waiting = present.vehicles.filter(({ withdrawn, active }) => active && withdrawn !== "").length;
    const held = stands.held || waiting > 0;
    const step = stepAfter(stands.step, {
      state: present.state,
      checking: preflightOpen.value,
      soundings: present.progress.soundings,
      mapped: seaFloor.value !== null && present.progress.soundings > 0,
      layer: layer.value,
      held: waiting,
      resumed: held && waiting === 0,
      corners: measured.value?.length ?? 0,
      tab: tab.value,
    });
    if (step !== stands.step || held !== stands.held) tour.value = { ...stands, step, held };
  });
  const stands = tour.value;
  const shown = stands !== null && selectedId.value === stands.mission;
  const step = shown ? TOUR[stands.step] : undefined;
  // Buttons come and go: each second is soon enough to mark the one that is there.
  now.value;
  useEffect(() => {
    const found = step?.marks
      .map((id) => document.querySelector(`[data-testid="${id}"]`))
      .find((element) => element !== null);
    if (marked.value !== found) marked.value?.classList.remove("tour-mark");
    found?.classList.add("tour-mark");
    marked.value = found ?? null;
  });
  useEffect(() => () => marked.value?.classList.remove("tour-mark"), []);
  if (!shown) return null;
  return (
    <aside
      class="notice tour"
      aria-label={say("tour.tour")}
      data-testid="tour"
      data-step={step?.name ?? "end"}
    >
      <p aria-live="polite">
        {step ? (
          <>
            <b>{say("tour.stepOf", { step: stands.step + 1, steps: TOUR.length })}</b>{" "}
            {say(step.words as "tour.end")}
          </>
        ) : (
          say("tour.end")
        )}
      </p>
      <Button
        id="end-tour"
        onClick={() => {
          tour.value = null;
        }}
      >
        {step ? say("tour.leave") : say("dialog.close")}
      </Button>
    </aside>
  );
}
