import "./PreflightDialog.css";
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import SPEC from "../../api/mission.json";
import type { CheckStatus, PreflightView } from "../../api/types";
import { floorDepthFault } from "../../state/form/missionFields";
import { pointed } from "../../state/format";
import { actionWords, busyWith, refusal, said, start } from "../../state/session";
import { floorDepth, mission, preflightOpen, selectedId } from "../../state/store";
import { say } from "../../words/say";
import { Forecast } from "../forecast/Forecast";
import { Button, sets, Typed } from "../parts/Controls";
import { Dialog } from "../parts/Dialog";

const SIGNS: Record<CheckStatus, string> = { ok: "✓", note: "•", warning: "▲", problem: "✕" };
const TONES: Record<CheckStatus, string> = { ok: "good", note: "calm", warning: "warning", problem: "alarm" };
const HEARD = {
  ok: "preflight.inOrder",
  note: "preflight.note",
  warning: "preflight.warning",
  problem: "preflight.problem",
} as const;
const AGAIN_MS = 3000;

/** The checklist before a start; starts the mission when nothing stands in its way. */
export function PreflightDialog() {
  const found = useSignal<PreflightView | null>(null);
  const fault = useSignal("");
  const confirmed = useSignal<readonly string[]>([]);
  const open = preflightOpen.value;
  const id = selectedId.value;

  useEffect(() => {
    if (!open || !id) return;
    let stopped = false;
    const look = async () => {
      try {
        const answer = await api.preflight(id);
        if (!stopped) {
          found.value = answer;
          fault.value = "";
        }
      } catch (error) {
        if (!stopped) fault.value = said(error);
      }
    };
    void look();
    const timer = setInterval(look, AGAIN_MS);
    return () => {
      stopped = true;
      clearInterval(timer);
      found.value = null;
      fault.value = "";
      // Another mission is looked at anew.
      confirmed.value = [];
    };
  }, [open, id]);

  const depth_m = pointed(floorDepth.value);
  const wrongDepth = floorDepthFault(depth_m);
  const close = sets(preflightOpen, false);
  const view = found.value;
  const questions = view?.questions ?? [];
  const begin = async () => {
    // Questions may be others since they were ticked: the service may have begun anew.
    if (await start(questions.filter((question) => confirmed.value.includes(question)))) close();
  };
  const unconfirmed = questions.filter((question) => !confirmed.value.includes(question)).length;
  const problems = view?.checks.filter((c) => c.status === "problem").length ?? 0;
  const refused = refusal.value?.what === actionWords("start") ? refusal.value.error : null;
  const starting = (
    <Button
      id="confirm-start"
      kind="command primary"
      commands
      disabled={!view?.ready || unconfirmed > 0}
      busy={busyWith.value !== null}
      onClick={() => void begin()}
    >
      {busyWith.value === "start"
        ? say("preflight.starting")
        : problems > 0
          ? say("preflight.problemToSolveFirst", { problems })
          : unconfirmed > 0
            ? say("preflight.toConfirmFirst", { unconfirmed })
            : say("preflight.startMission")}
    </Button>
  );
  return (
    <Dialog
      open={open}
      onClose={close}
      name="preflight"
      id="preflight"
      heading={say("preflight.start", { mission: mission.value?.name ?? say("abort.theMission") })}
      fault={refused ? said(refused) : fault.value}
      closing={say("preflight.notYet")}
      actions={starting}
      kind="preflight"
      data={{ "data-ready": view?.ready ?? "unknown" }}
    >
      {view ? null : <p>{say("preflight.lookingAtTheVehicles")}</p>}
      <ul class="checklist">
        {view?.checks.map((check) => (
          <li key={check.id} data-testid={`check-${check.id}`} data-status={check.status}>
            <span class={`tone ${TONES[check.status]}`}>
              <span aria-hidden="true">{SIGNS[check.status]}</span>
              <span class="visually-hidden">{say(HEARD[check.status])}:</span>
            </span>
            <span>
              <b>{check.title}</b> {check.message}
              {check.remedy ? <span class={`remedy ${TONES[check.status]}`}> → {check.remedy}</span> : null}
            </span>
          </li>
        ))}
      </ul>
      {questions.length > 0 ? (
        <fieldset class="questions">
          <legend>{say("preflight.toBeConfirmed")}</legend>
          {questions.map((question, index) => (
            <label key={question}>
              <input
                type="checkbox"
                data-testid={`question-${index}`}
                checked={confirmed.value.includes(question)}
                onChange={(event) => {
                  const others = confirmed.value.filter((one) => one !== question);
                  confirmed.value = event.currentTarget.checked ? [...others, question] : others;
                }}
              />{" "}
              {question}
            </label>
          ))}
        </fieldset>
      ) : null}
      {open && selectedId.value && mission.value?.spec.kind !== "search" ? (
        <>
          <label class="field">
            {say("asked.depthOfTheBottomM")}
            <Typed
              text={floorDepth}
              id="preflight-floor_depth_m"
              placeholder={say("asked.aGuess")}
              invalid={wrongDepth !== ""}
            />
            {wrongDepth ? (
              <span class="fault" data-testid="fault-floor_depth_m">
                ▲ {wrongDepth}
              </span>
            ) : null}
            <small>{SPEC.floor_depth_m.description}</small>
          </label>
          {wrongDepth ? null : (
            <Forecast
              of={`${selectedId.value} ${depth_m}`}
              asks={[(gone) => api.forecast(selectedId.peek() ?? "", depth_m, gone)]}
            />
          )}
        </>
      ) : null}
    </Dialog>
  );
}
