import "./Forecast.css";
import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { ForecastView } from "../../api/types";
import { distance, duration, metres, percent } from "../../state/format";
import { said } from "../../state/session";
import { say } from "../../words/say";
import { Button } from "../parts/Controls";
import { WholeSurvey } from "./WholeSurvey";

/**
 * What a quick simulation says of a mission. It is asked for by a button; `of` names what it was made of, so that it is
 * taken away when that changes.
 */
export function Forecast({ of, ask }: { of: string; ask: (gone: AbortSignal) => Promise<ForecastView> }) {
  const found = useSignal<ForecastView | null>(null);
  const fault = useSignal("");
  const waiting = useSignal(false);
  const request = useRef<AbortController | null>(null);

  // Nobody waits for the answer any more: the service ends what it does.
  useEffect(
    () => () => {
      request.current?.abort();
      found.value = null;
      fault.value = "";
      waiting.value = false;
    },
    [of],
  );
  const start = async () => {
    const mine = new AbortController();
    request.current = mine;
    waiting.value = true;
    fault.value = "";
    try {
      const answer = await ask(mine.signal);
      if (!mine.signal.aborted) found.value = answer;
    } catch (error) {
      if (!mine.signal.aborted) fault.value = said(error);
    } finally {
      if (!mine.signal.aborted) waiting.value = false;
    }
  };
  const view = found.value;
  return (
    <section class="forecast" aria-live="polite" data-testid="forecast">
      {view ? <Found view={view} /> : null}
      {fault.value ? (
        <p class="reason alarm" role="alert">
          {fault.value}
        </p>
      ) : null}
      {waiting.value ? (
        <p class="hint">
          {say("forecast.simulatingTheMissionOver")}{" "}
          <Button
            onClick={() => {
              request.current?.abort();
              waiting.value = false;
            }}
          >
            {say("abort.stop")}
          </Button>
        </p>
      ) : view ? null : (
        <Button id="ask-forecast" onClick={() => void start()}>
          {say("forecast.forecastByAQuickSimulation")}
        </Button>
      )}
    </section>
  );
}

/** "low to high" where they differ as they are shown. */
function between(range: { low: number; high: number } | null, shown: (value: number) => string): string {
  if (range === null) return "–";
  const [low, high] = [shown(range.low), shown(range.high)];
  return low === high ? low : say("forecast.to", { low, high });
}

function Found({ view }: { view: ForecastView }) {
  const simulated =
    view.steps_simulated < view.steps && !view.whole_survey
      ? say("forecast.afterSteps", { stepsSimulated: view.steps_simulated })
      : "";
  return (
    <>
      <h3>{say("forecast.forecastNotMeasured")}</h3>
      <dl class="figures">
        <div class="figure">
          <dt>{say("forecast.duration")}</dt>
          <dd data-testid="forecast-duration">{between(view.duration_s_range, duration)}</dd>
        </div>
        <div class="figure">
          <dt>{view.whole_survey ? say("forecast.ensonified") : say("forecast.wellKnown", { simulated })}</dt>
          <dd data-testid="forecast-coverage">{between(view.coverage_pct_range, percent)}</dd>
        </div>
        {view.whole_survey ? null : (
          <div class="figure">
            <dt>{say("forecast.landmarksLeft", { simulated })}</dt>
            <dd>{between(view.remaining_pct_range, percent)}</dd>
          </div>
        )}
        <div class="figure">
          <dt>{say("forecast.meanDeviation", { simulated })}</dt>
          <dd>{between(view.mean_sd_m_range, (sd) => metres(sd, 2))}</dd>
        </div>
      </dl>
      <p class="hint">
        {view.vehicles.map((v) => `${v.vehicle} ${between(v.distance_m_range, distance)}`).join(" · ")}
      </p>
      {view.whole_survey ? <WholeSurvey whole={view.whole_survey} /> : null}
      <ul class="hint assumptions">
        {view.assumptions.map((words) => (
          <li key={words}>{words}</li>
        ))}
      </ul>
    </>
  );
}
