import { useSignal, useSignalEffect } from "@preact/signals";
import { api } from "../../api/client";
import type { SystematicErrorsView, SystematicErrorView } from "../../api/types";
import { quantity } from "../../state/format";
import { said } from "../../state/session";
import { selectedId } from "../../state/store";
import { say } from "../../words/say";
import { Button } from "../parts/Controls";

const WORDS: Record<SystematicErrorView["kind"], string> = {
  get depth() {
    return say("systematicErrors.depthsTooLargeBy");
  },
  get water_level() {
    return say("systematicErrors.waterLevelHigherByUpTo");
  },
  get roll_offset() {
    return say("systematicErrors.sonarToStarboardBy");
  },
  get sound_speed() {
    return say("systematicErrors.soundAtTheSonarFasterBy");
  },
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
    <section class="systematic" aria-label={say("systematicErrors.systematicErrors")}>
      <h3>{say("systematicErrors.systematicErrors")}</h3>
      {found ? (
        <>
          <ul class="small" data-testid="systematic-errors">
            {found.errors.map((error) => (
              <li key={`${error.kind} ${error.vehicle}`} class={error.proposed ? "" : "quiet"}>
                {error.vehicle ?? say("systematicErrors.all")}: {WORDS[error.kind]}{" "}
                {quantity(error.found, error.unit)} ± {quantity(error.sd, error.unit).slice(1)}
                <br />
                {error.proposed ? say("systematicErrors.canBeTakenOut") : say("systematicErrors.leftIn")}:{" "}
                {error.why}
              </li>
            ))}
            {found.unknown.map((text) => (
              <li key={text} class="quiet">
                {say("systematicErrors.notKnown", { text })}
              </li>
            ))}
          </ul>
          {applied > 0 ? (
            <p class="small">
              {say("systematicErrors.someAreTakenOutAlready", {
                source: found.applied.source || say("systematicErrors.byHand"),
              })}
            </p>
          ) : null}
        </>
      ) : null}
      <p class="row">
        <Button id="look-for-errors" busy={busy.value} onClick={() => look()}>
          {found ? say("systematicErrors.lookAgain") : say("systematicErrors.lookForSystematicErrors")}
        </Button>
        {proposal ? (
          <Button
            id="take-out-errors"
            commands
            busy={busy.value}
            onClick={() => look((id) => api.setSystematicErrors(id, proposal))}
          >
            {say("systematicErrors.takeOutWhatIsProposed")}
          </Button>
        ) : null}
        {applied > 0 ? (
          <Button
            id="undo-errors"
            commands
            busy={busy.value}
            onClick={() => look(api.deleteSystematicErrors)}
          >
            {say("systematicErrors.takeNothingOut")}
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
