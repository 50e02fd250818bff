import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { StopView } from "../api/types";
import { abortVehicle, act, refusal } from "../state/session";
import { abortDialogOpen, abortOne, mission, vehicles } from "../state/store";
import { hasEnded } from "../state/words";

/** Asks once, then stays until it has shown what every vehicle answered. Of the whole team, or of one vehicle. */
export function AbortDialog() {
  const dialog = useRef<HTMLDialogElement>(null);
  const receipts = useSignal<readonly StopView[] | null>(null);
  const sending = useSignal(false);
  const open = abortDialogOpen.value;
  const only = abortOne.value;

  useEffect(() => {
    if (open) {
      receipts.value = null;
      dialog.current?.showModal();
    } else {
      dialog.current?.close();
    }
  }, [open]);

  const close = () => {
    abortDialogOpen.value = false;
    abortOne.value = null;
  };
  const abort = async () => {
    sending.value = true;
    try {
      const answer = await (only ? abortVehicle(only) : act("abort"));
      if (answer) receipts.value = answer.stops;
    } finally {
      sending.value = false;
    }
  };
  const what = only ? `abort of ${only}` : "abort";
  const refused = refusal.value?.what === what ? refusal.value.error : null;
  const again = only !== null && mission.value !== null && hasEnded(mission.value.state);
  const name = only ?? mission.value?.name ?? "the mission";

  return (
    <dialog
      ref={dialog}
      class="dialog"
      aria-labelledby="abort-title"
      onClose={close}
      data-testid="abort-dialog"
    >
      <h2 id="abort-title">
        {receipts.value ? doneTitle(only, again) : `${again ? "Stop" : "Abort"} ${name}?`}
      </h2>
      {receipts.value ? null : <p>{consequence(only, again)}</p>}
      <ul class="receipts" aria-live="polite">
        {rows(receipts.value, sending.value, only).map((row) => (
          <li key={row.vehicle} class={row.tone} data-testid={`receipt-${row.vehicle}`}>
            <span aria-hidden="true">{row.sign}</span> <b>{row.vehicle}</b> {row.words}
          </li>
        ))}
      </ul>
      {receipts.value?.length === 0 ? <p>No vehicle was under way.</p> : null}
      {receipts.value?.some((r) => !r.acknowledged) ? (
        <p class="reason alarm">
          A vehicle that did not acknowledge may go on until its own time-out. Watch it, and stop it from its
          console if it does not surface.
        </p>
      ) : null}
      {refused ? (
        <p class="reason alarm" role="alert">
          {refused.message}. {refused.remedy}
        </p>
      ) : null}
      <div class="dialog-actions">
        <button type="button" class="command" onClick={close} data-testid="abort-close">
          {receipts.value ? "Close" : "Keep going"}
        </button>
        {receipts.value ? null : (
          <button
            type="button"
            class="abort"
            disabled={sending.value}
            onClick={() => void abort()}
            data-testid="abort-confirm"
          >
            {sending.value ? "Aborting…" : only ? `${again ? "Stop" : "Abort"} ${only}` : "Abort mission"}
          </button>
        )}
      </div>
    </dialog>
  );
}

/** `again`: the mission has ended, and a vehicle is told once more. */
function doneTitle(only: string | null, again: boolean): string {
  if (only === null) return "Mission aborted";
  return again ? `${only} was told again` : `${only} was taken out`;
}

function consequence(only: string | null, again: boolean): string {
  if (again) return "It did not acknowledge its last stop. It is told once more.";
  return only
    ? "This vehicle is told to stop and leaves the mission; the others go on. It can be added again."
    : "Every vehicle is told to stop following its waypoints. An aborted mission cannot be resumed; its map stays.";
}

function rows(receipts: readonly StopView[] | null, sending: boolean, only: string | null) {
  if (receipts) {
    return receipts.map((r) => ({
      vehicle: r.vehicle,
      tone: r.acknowledged ? "good" : "alarm",
      sign: r.acknowledged ? "✓" : "✕",
      words: `${r.acknowledged ? "acknowledged the stop" : "did not acknowledge"}${r.detail ? `: ${r.detail}` : ""}`,
    }));
  }
  return vehicles.value
    .filter((v) => v.view.active && (only === null || v.view.name === only))
    .map((v) => ({
      vehicle: v.view.name,
      tone: "calm",
      sign: sending ? "…" : "•",
      words: sending ? "waiting for its acknowledgement" : "",
    }));
}
