import { abortVehicle, act, actionWords } from "../../state/session";
import { canReturn, hasEnded } from "../../state/stateNames";
import { abortDialogOpen, abortOne, mission, type Vehicle, vehicles } from "../../state/store";
import { say, sayWith } from "../../words/say";
import { Button } from "../parts/Controls";
import { StopDialog } from "./StopDialog";

/** Of the whole team, or of one vehicle, which can be chosen here, too: the cards may be covered. */
export function AbortDialog() {
  const open = abortDialogOpen.value;
  const only = abortOne.value;
  const again = only !== null && mission.value !== null && hasEnded(mission.value);
  const verb = again ? say("abort.stop") : say("abort.abort");
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
      what={only ? say("session.abortOf", { name: only }) : actionWords("abort")}
      question={`${verb} ${only ?? mission.value?.name ?? say("abort.theMission")}?`}
      done={doneTitle(only, again)}
      send={() => (only ? abortVehicle(only) : act("abort"))}
      sendHome={home ? () => act("abort", true) : undefined}
      confirm={(sending) =>
        sending
          ? say("abort.aborting")
          : only
            ? `${verb} ${only}`
            : home || mission.value?.ending
              ? say("abort.stopNow")
              : say("abort.abortMission")
      }
      confirmId="abort-confirm"
    >
      {(sending) => (
        <>
          <p>{consequence(only, again)}</p>
          {home ? (
            <p>{sayWith("abort.withTheyGoToTheirRecovery", { b: <b>{say("abort.returnHome")}</b> })}</p>
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
        {sending ? say("abort.waitingForItsAcknowledgement") : ""}
      </span>
      {choice && !sending ? (
        <Button
          id={`abort-only-${name}`}
          kind="abort-one"
          onClick={() => {
            abortOne.value = name;
          }}
        >
          {say("abort.only", { name })}
        </Button>
      ) : null}
    </li>
  );
}

/** `again`: the mission has ended, and a vehicle is told once more. */
function doneTitle(only: string | null, again: boolean): string {
  if (only === null) return say("abort.missionAborted");
  return again ? say("abort.wasToldAgain", { only }) : say("abort.wasTakenOut", { only });
}

function consequence(only: string | null, again: boolean): string {
  if (again) return say("abort.itDidNotAcknowledgeItsLast");
  return only ? say("abort.thisVehicleIsToldToStop") : say("abort.everyVehicleIsToldToStop");
}
