import "./FinishDialog.css";
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { StopView } from "../api/types";
import { act, refusal } from "../state/session";
import { finishOpen, mission } from "../state/store";
import { Dialog } from "./Dialog";
import { Receipts } from "./Receipts";

/** Asks before a mission is ended early, and shows what every vehicle answered. */
export function FinishDialog() {
  const stops = useSignal<readonly StopView[] | null>(null);
  const sending = useSignal(false);
  const open = finishOpen.value;
  const present = mission.value;

  useEffect(() => {
    if (open) stops.value = null;
  }, [open]);

  const close = () => {
    finishOpen.value = false;
  };
  const finish = async () => {
    sending.value = true;
    try {
      const answer = await act("finish");
      if (answer) stops.value = answer.stops;
    } finally {
      sending.value = false;
    }
  };
  const refused = refusal.value?.what === "finish" ? refusal.value.error : null;
  return (
    <Dialog open={open} onClose={close} title="finish-title" id="finish-dialog" kind="finishing">
      <h2 id="finish-title">{stops.value ? "Mission finished" : `Finish ${present?.name ?? ""} early?`}</h2>
      {stops.value ? (
        <Receipts stops={stops.value} />
      ) : (
        <p>
          {present
            ? `Step ${present.progress.step} of ${present.progress.steps} is under way. The vehicles are stopped where they are; `
            : ""}
          a finished mission cannot be resumed. Its map and files stay.
        </p>
      )}
      {refused ? (
        <p class="reason alarm" role="alert">
          {refused.message}. {refused.remedy}
        </p>
      ) : null}
      <div class="dialog-actions">
        <button type="button" class="command" onClick={close} data-testid="finish-close">
          {stops.value ? "Close" : "Keep going"}
        </button>
        {stops.value ? null : (
          <button
            type="button"
            class="command primary"
            disabled={sending.value}
            onClick={() => void finish()}
            data-testid="confirm-finish"
          >
            {sending.value ? "Finishing…" : "Finish mission"}
          </button>
        )}
      </div>
    </Dialog>
  );
}
