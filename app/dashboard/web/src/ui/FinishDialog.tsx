import "./FinishDialog.css";
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import SPEC from "../api/mission.json";
import { act } from "../state/session";
import { finishOpen, mission } from "../state/store";
import { canReturn, capital, lengthWords } from "../state/words";
import { sets } from "./Controls";
import { StopDialog } from "./StopDialog";

/** Before a mission is ended early: vehicles go home first where they have one, unless they are to stop. */
export function FinishDialog() {
  const present = mission.value;
  const open = finishOpen.value;
  const home = present !== null && canReturn(present, present.vehicles);
  const first = useSignal(true);
  useEffect(() => {
    const usual = mission.peek()?.spec.recovery?.on_finish ?? SPEC["recovery.on_finish"].default;
    if (open) first.value = usual === "return";
  }, [open]);
  const returns = home && first.value;
  const choice = (value: boolean, title: string, words: string, id: string) => (
    <label class="preset">
      <input
        type="radio"
        name="finish-how"
        checked={first.value === value}
        data-testid={id}
        onChange={sets(first, value)}
      />
      <span>
        <b>{title}</b> <small>{words}</small>
      </span>
    </label>
  );
  return (
    <StopDialog
      open={open}
      onClose={sets(finishOpen, false)}
      name="finish"
      kind="finishing"
      what="finish"
      question={present?.ending ? "Stop the vehicles now?" : `Finish ${present?.name ?? ""} early?`}
      done="Mission finished"
      send={() => act("finish", returns)}
      confirm={(sending) => (sending ? "Finishing…" : present?.ending ? "Stop now" : "Finish mission")}
      confirmId="confirm-finish"
    >
      {() => (
        <>
          <p>
            {present ? `${capital(lengthWords(present.progress))} is under way. ` : ""}
            {home ? "" : "The vehicles are stopped where they are. "}A finished mission cannot be resumed. Its
            map and files stay.
          </p>
          {home ? (
            <fieldset class="how" aria-label="What the vehicles do">
              {choice(
                true,
                "Return home first",
                "It is finished once all are at their recovery points.",
                "finish-return",
              )}
              {choice(false, "Stop where they are", "It is finished now.", "finish-stop")}
            </fieldset>
          ) : null}
        </>
      )}
    </StopDialog>
  );
}
