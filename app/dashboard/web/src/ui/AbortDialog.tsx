import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { StopView } from "../api/types";
import { act, busyWith, refusal } from "../state/session";
import { abortDialogOpen, mission, vehicles } from "../state/store";

/** Asks once, then stays until it has shown what every vehicle answered. */
export function AbortDialog() {
  const dialog = useRef<HTMLDialogElement>(null);
  const receipts = useSignal<readonly StopView[] | null>(null);
  const open = abortDialogOpen.value;

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
  };
  const abort = async () => {
    const answer = await act("abort");
    if (answer) receipts.value = answer.stops;
  };
  const sending = busyWith.value === "abort";
  const refused = refusal.value?.what === "abort" ? refusal.value.error : null;

  return (
    <dialog
      ref={dialog}
      class="dialog"
      aria-labelledby="abort-title"
      onClose={close}
      data-testid="abort-dialog"
    >
      <h2 id="abort-title">
        {receipts.value ? "Mission aborted" : `Abort ${mission.value?.name ?? "the mission"}?`}
      </h2>
      {receipts.value ? null : (
        <p>
          Every vehicle is told to stop following its waypoints. An aborted mission cannot be resumed; its map
          stays.
        </p>
      )}
      <ul class="receipts" aria-live="polite">
        {rows(receipts.value, sending).map((row) => (
          <li key={row.vehicle} class={row.tone} data-testid={`receipt-${row.vehicle}`}>
            <span aria-hidden="true">{row.sign}</span> <b>{row.vehicle}</b> {row.words}
          </li>
        ))}
      </ul>
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
            disabled={sending}
            onClick={() => void abort()}
            data-testid="abort-confirm"
          >
            {sending ? "Aborting…" : "Abort mission"}
          </button>
        )}
      </div>
    </dialog>
  );
}

function rows(receipts: readonly StopView[] | null, sending: boolean) {
  if (receipts) {
    return receipts.map((r) => ({
      vehicle: r.vehicle,
      tone: r.acknowledged ? "good" : "alarm",
      sign: r.acknowledged ? "✓" : "✕",
      words: `${r.acknowledged ? "acknowledged the stop" : "did not acknowledge"}${r.detail ? `: ${r.detail}` : ""}`,
    }));
  }
  return vehicles.value
    .filter((v) => v.view.active)
    .map((v) => ({
      vehicle: v.view.name,
      tone: "calm",
      sign: sending ? "…" : "•",
      words: sending ? "waiting for its acknowledgement" : "",
    }));
}
