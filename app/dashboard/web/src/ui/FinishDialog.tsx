import "./FinishDialog.css";
import { act } from "../state/session";
import { finishOpen, mission } from "../state/store";
import { capital, lengthWords } from "../state/words";
import { sets } from "./Controls";
import { StopDialog } from "./StopDialog";

/** Before a mission is ended early. */
export function FinishDialog() {
  const progress = mission.value?.progress;
  return (
    <StopDialog
      open={finishOpen.value}
      onClose={sets(finishOpen, false)}
      name="finish"
      kind="finishing"
      what="finish"
      question={`Finish ${mission.value?.name ?? ""} early?`}
      done="Mission finished"
      send={() => act("finish")}
      confirm={(sending) => (sending ? "Finishing…" : "Finish mission")}
      confirmId="confirm-finish"
    >
      {() => (
        <p>
          {progress
            ? `${capital(lengthWords(progress))} is under way. The vehicles are stopped where they are; `
            : ""}
          a finished mission cannot be resumed. Its map and files stay.
        </p>
      )}
    </StopDialog>
  );
}
