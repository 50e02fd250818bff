import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { StopView } from "../api/types";
import { abortVehicle, act, refusal } from "../state/session";
import { abortDialogOpen, abortOne, mission, type Vehicle, vehicles } from "../state/store";
import { hasEnded } from "../state/words";
import { Dialog } from "./Dialog";
import { Receipts } from "./Receipts";

/**
 * Asks once, then stays until it has shown what every vehicle answered. Of the whole team, or of one vehicle, which can
 * be chosen here, too: the cards may be covered.
 */
export function AbortDialog() {
  const receipts = useSignal<readonly StopView[] | null>(null);
  const sending = useSignal(false);
  const open = abortDialogOpen.value;
  const only = abortOne.value;

  useEffect(() => {
    if (open) receipts.value = null;
  }, [open, only]);

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
  const again = only !== null && mission.value !== null && hasEnded(mission.value);
  const name = only ?? mission.value?.name ?? "the mission";
  const asked = !open
    ? []
    : vehicles.value.filter((v) => v.view.active && (only === null || v.view.name === only));

  return (
    <Dialog open={open} onClose={close} title="abort-title" id="abort-dialog" kind="stopping" above>
      <h2 id="abort-title">
        {receipts.value ? doneTitle(only, again) : `${again ? "Stop" : "Abort"} ${name}?`}
      </h2>
      {receipts.value ? (
        <Receipts stops={receipts.value} />
      ) : (
        <>
          <p>{consequence(only, again)}</p>
          <ul class="receipts" aria-live="polite">
            {asked.map((vehicle) => (
              <Asked
                key={vehicle.view.name}
                vehicle={vehicle}
                sending={sending.value}
                choice={only === null && asked.length > 1}
              />
            ))}
          </ul>
        </>
      )}
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
    </Dialog>
  );
}

/** A vehicle that is about to be stopped; of several each can be stopped alone. */
function Asked({ vehicle, sending, choice }: { vehicle: Vehicle; sending: boolean; choice: boolean }) {
  const { name } = vehicle.view;
  return (
    <li class="calm" data-testid={`receipt-${name}`}>
      <span>
        <span aria-hidden="true">{sending ? "…" : "•"}</span> <b>{name}</b>{" "}
        {sending ? "waiting for its acknowledgement" : ""}
      </span>
      {choice && !sending ? (
        <button
          type="button"
          class="abort-one"
          data-testid={`abort-only-${name}`}
          onClick={() => {
            abortOne.value = name;
          }}
        >
          Only {name}…
        </button>
      ) : null}
    </li>
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
    ? "This vehicle is told to stop and leaves the mission; the others go on. It stays in sight and can be added again."
    : "Every vehicle is told to stop following its waypoints. An aborted mission cannot be resumed; its map stays.";
}
