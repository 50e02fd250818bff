import "./FinishDialog.css";
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import SPEC from "../../api/mission.json";
import { act, actionWords } from "../../state/session";
import { canReturn, capital, lengthWords } from "../../state/stateNames";
import { finishOpen, mission, missions } from "../../state/store";
import { say } from "../../words/say";
import { sets } from "../parts/Controls";
import { StopDialog } from "./StopDialog";

/** Before a mission is ended early: vehicles go home first where they have one, unless they are to stop. */
export function FinishDialog() {
  const present = mission.value;
  const open = finishOpen.value;
  const home = present !== null && canReturn(present, present.vehicles);
  const next = missions.value?.find(({ after, state }) => after === present?.id && state === "ready");
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
      what={actionWords("finish")}
      question={
        present?.ending
          ? say("finish.stopTheVehiclesNow")
          : say("finish.finishEarly", { present: present?.name ?? "" })
      }
      done={say("finish.missionFinished")}
      send={() => act("finish", returns)}
      confirm={(sending) =>
        sending
          ? say("finish.finishing")
          : present?.ending
            ? say("abort.stopNow")
            : say("finish.finishMission")
      }
      confirmId="confirm-finish"
    >
      {() => (
        <>
          <p>
            {say("finish.aFinishedMissionCannotBe", {
              it: present
                ? say("finish.isUnderWay", { progress: capital(lengthWords(present.progress)) })
                : "",
              it2: home ? "" : say("finish.theVehiclesAreStoppedWhere"),
            })}
          </p>
          {next ? (
            <p data-testid="does-not-follow">{say("blocks.doesNotFollow", { name: next.name })}</p>
          ) : null}
          {home ? (
            <fieldset class="how" aria-label={say("finish.whatTheVehiclesDo")}>
              {choice(
                true,
                say("finish.returnHomeFirst"),
                say("finish.itIsFinishedOnceAllAre"),
                "finish-return",
              )}
              {choice(false, say("finish.stopWhereTheyAre"), say("finish.itIsFinishedNow"), "finish-stop")}
            </fieldset>
          ) : null}
        </>
      )}
    </StopDialog>
  );
}
