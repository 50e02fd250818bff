import { abortVehicle, act } from "../state/session";
import { abortDialogOpen, abortOne, mission, type Vehicle, vehicles } from "../state/store";
import { canReturn, hasEnded } from "../state/words";
import { Button } from "./Controls";
import { StopDialog } from "./StopDialog";

/** Of the whole team, or of one vehicle, which can be chosen here, too: the cards may be covered. */
export function AbortDialog() {
  const open = abortDialogOpen.value;
  const only = abortOne.value;
  const again = only !== null && mission.value !== null && hasEnded(mission.value);
  const verb = again ? "Stop" : "Abort";
  const team = open ? vehicles.value.filter((v) => v.view.active) : [];
  const home =
    only === null &&
    mission.value !== null &&
    canReturn(
      mission.value,
      team.map((v) => v.view),
    );
  const asked = team.filter((v) => only === null || v.view.name === only);
  return (
    <StopDialog
      open={open}
      onClose={() => {
        abortDialogOpen.value = false;
        abortOne.value = null;
      }}
      name="abort"
      kind="stopping"
      above
      what={only ? `abort of ${only}` : "abort"}
      question={`${verb} ${only ?? mission.value?.name ?? "the mission"}?`}
      done={doneTitle(only, again)}
      send={() => (only ? abortVehicle(only) : act("abort"))}
      sendHome={home ? () => act("abort", true) : undefined}
      confirm={(sending) =>
        sending
          ? "Aborting…"
          : only
            ? `${verb} ${only}`
            : home || mission.value?.ending
              ? "Stop now"
              : "Abort mission"
      }
      confirmId="abort-confirm"
    >
      {(sending) => (
        <>
          <p>{consequence(only, again)}</p>
          {home ? (
            <p>
              With <b>Return home</b> they go to their recovery points first, and the mission is aborted once
              all are there.
            </p>
          ) : null}
          <ul class="receipts" aria-live="polite">
            {asked.map((vehicle) => (
              <Asked
                key={vehicle.view.name}
                vehicle={vehicle}
                sending={sending}
                choice={only === null && asked.length > 1}
              />
            ))}
          </ul>
        </>
      )}
    </StopDialog>
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
        <Button
          id={`abort-only-${name}`}
          kind="abort-one"
          onClick={() => {
            abortOne.value = name;
          }}
        >
          Only {name}…
        </Button>
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
