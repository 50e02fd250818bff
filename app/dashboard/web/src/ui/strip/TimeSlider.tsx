import "./TimeSlider.css";
import { clock } from "../../state/format";
import { awaited, pace, playing, replay, showPresent } from "../../state/past/replay";
import { flownWords, hasEnded, isAllowed } from "../../state/stateNames";
import { finishOpen, lengthOpen, live, mission, replayStep, steps } from "../../state/store";
import { say, sayWith } from "../../words/say";
import { Button, sets } from "../parts/Controls";

/** How far the mission has come, and back to any step of it. */
export function TimeSlider() {
  const present = mission.value;
  if (!present) return null;
  const { step: last, steps: planned } = present.progress;
  const shown = replayStep.value;
  const flown = shown === null ? flownWords(present.progress) : null;
  const past = steps.value.find((s) => s.number === shown);
  const over = hasEnded(present);
  return (
    <div class={`timeline${shown === null ? "" : " past"}`}>
      <span class="steps">
        {sayWith("time.step", {
          b: <b data-testid="step">{shown ?? last}</b>,
          it: flown === null ? say("time.of", { planned: shown === null ? planned : last }) : ` · ${flown}`,
        })}
      </span>
      <Button
        id="play"
        kind="tool"
        disabled={last === 0}
        title={playing.value ? say("time.stopTheReplay") : say("time.replayTheMission")}
        aria-label={playing.value ? say("time.stopTheReplay") : say("time.replayTheMission")}
        onClick={async () => {
          if (playing.value) {
            playing.value = false;
            return;
          }
          await replay(shown === null || shown >= last ? 1 : shown + 1);
          playing.value = true;
        }}
      >
        {playing.value ? "❚❚" : "▶"}
      </Button>
      <input
        type="range"
        min={last > 0 ? 1 : 0}
        max={Math.max(1, last)}
        value={awaited.value ?? shown ?? last}
        disabled={last === 0}
        aria-label={say("time.stepThatIsShown")}
        aria-valuetext={shown === null ? say("time.thePresent") : say("time.stepOf", { shown, last })}
        data-testid="slider"
        onInput={(event) => {
          playing.value = false;
          void replay(Number(event.currentTarget.value));
        }}
      />
      {shown === null ? (
        <>
          <span class="when">
            {awaited.value !== null
              ? say("time.fetching")
              : over
                ? say("time.asItEnded")
                : live.value
                  ? say("time.live")
                  : say("time.notLive")}
          </span>
          {isAllowed("finish", present) && !present.ending && present.spec.kind !== "search" ? (
            <Button
              id="change-length"
              kind="command finish"
              commands
              title={say("length.makeItLongerOrShorter")}
              onClick={sets(lengthOpen, true)}
            >
              {say("length.change")}
            </Button>
          ) : null}
          {isAllowed("finish", present) ? (
            <Button
              id="finish"
              kind="command finish"
              commands
              title={say("time.endTheMissionBeforeItsLast")}
              onClick={sets(finishOpen, true)}
            >
              {say("time.finishEarly")}
            </Button>
          ) : null}
        </>
      ) : (
        <>
          <span class="when" data-testid="replayed-at" role="status">
            {say("time.replay", {
              // Steps are decided before they are flown, by some planners long before.
              it: past ? say("time.decidedAt", { it: clock(new Date(past.committed_at), "utc") }) : "",
            })}
          </span>
          <label class="pace">
            <span class="visually-hidden">{say("time.paceOfTheReplay")}</span>
            <select
              value={pace.value}
              onChange={(event) => {
                pace.value = Number(event.currentTarget.value);
              }}
            >
              {[1, 4, 10, 25].map((n) => (
                <option key={n} value={n}>
                  {say("time.stepsS", { n })}
                </option>
              ))}
            </select>
          </label>
          <Button id="to-present" kind="command primary" onClick={showPresent}>
            {over ? say("time.toTheEnd") : say("time.live2")}
          </Button>
        </>
      )}
    </div>
  );
}
