import { useSignal, useSignalEffect } from "@preact/signals";
import { api } from "../api/client";
import type { SystematicErrorsView, SystematicErrorView } from "../api/types";
import { quantity } from "../state/format";
import { said } from "../state/session";
import { selectedId } from "../state/store";
import { Button } from "./Controls";

const WORDS: Record<SystematicErrorView["kind"], string> = {
  depth: "depths too large by",
  water_level: "water level higher by up to",
  roll_offset: "sonar to starboard by",
  sound_speed: "sound at the sonar faster by",
};

/** What is always wrong with sonars and water levels, as the survey shows it, to be taken out by a click. */
export function SystematicErrors() {
  const answer = useSignal<SystematicErrorsView | null>(null);
  const busy = useSignal(false);
  const fault = useSignal("");
  useSignalEffect(() => {
    selectedId.value;
    answer.value = null;
    fault.value = "";
  });

  /** Change something first, if anything, then look. */
  const look = async (change?: (id: string) => Promise<unknown>) => {
    const id = selectedId.peek();
    if (!id) return;
    busy.value = true;
    fault.value = "";
    try {
      await change?.(id);
      const found = await api.systematicErrors(id);
      if (selectedId.peek() === id) answer.value = found;
    } catch (error) {
      fault.value = said(error);
    } finally {
      busy.value = false;
    }
  };

  const found = answer.value;
  const proposal = found?.proposal;
  const applied = found ? Object.keys(found.applied.vehicles).length + found.applied.water_level.length : 0;
  return (
    <section class="systematic" aria-label="Systematic errors">
      <h3>Systematic errors</h3>
      {found ? (
        <>
          <ul class="small" data-testid="systematic-errors">
            {found.errors.map((error) => (
              <li key={`${error.kind} ${error.vehicle}`} class={error.proposed ? "" : "quiet"}>
                {error.vehicle ?? "All"}: {WORDS[error.kind]} {quantity(error.found, error.unit)} ±{" "}
                {quantity(error.sd, error.unit).slice(1)}
                <br />
                {error.proposed ? "Can be taken out" : "Left in"}: {error.why}
              </li>
            ))}
            {found.unknown.map((text) => (
              <li key={text} class="quiet">
                Not known: {text}
              </li>
            ))}
          </ul>
          {applied > 0 ? (
            <p class="small">Some are taken out already ({found.applied.source || "by hand"}).</p>
          ) : null}
        </>
      ) : null}
      <p class="row">
        <Button id="look-for-errors" disabled={busy.value} onClick={() => look()}>
          {found ? "Look again" : "Look for systematic errors"}
        </Button>
        {proposal ? (
          <Button
            id="take-out-errors"
            commands
            disabled={busy.value}
            onClick={() => look((id) => api.setSystematicErrors(id, proposal))}
          >
            Take out what is proposed
          </Button>
        ) : null}
        {applied > 0 ? (
          <Button
            id="undo-errors"
            commands
            disabled={busy.value}
            onClick={() => look(api.deleteSystematicErrors)}
          >
            Take nothing out
          </Button>
        ) : null}
      </p>
      {fault.value ? (
        <p class="problem small" role="alert">
          {fault.value}
        </p>
      ) : null}
    </section>
  );
}
