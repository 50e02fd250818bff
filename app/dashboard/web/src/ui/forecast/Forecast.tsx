import "./Forecast.css";
import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { ForecastView } from "../../api/types";
import { forecastInAll } from "../../state/form/blocks";
import { distance, duration, durations, metres, percent } from "../../state/format";
import { said } from "../../state/session";
import { say } from "../../words/say";
import { Button } from "../parts/Controls";
import { WholeSurvey } from "./WholeSurvey";

interface ForecastProps {
  /** What it is made of: it is taken away when that changes. */
  of: string;
  /** For each mission, in their order. */
  asks: readonly ((gone: AbortSignal) => Promise<ForecastView>)[];
  /** Of the missions, where there are several. */
  names?: readonly string[];
}

/** What a quick simulation says of a mission, or of several that are flown one after the other. It is asked for by a button. */
export function Forecast({ of, asks, names = [] }: ForecastProps) {
  const found = useSignal<readonly ForecastView[]>([]);
  const fault = useSignal("");
  const waiting = useSignal(false);
  const request = useRef<AbortController | null>(null);

  // Nobody waits for the answer any more: the service ends what it does.
  useEffect(
    () => () => {
      request.current?.abort();
      found.value = [];
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
      // What there is of a forecast that was stopped stays.
      for (const ask of asks.slice(found.peek().length)) {
        const answer = await ask(mine.signal);
        if (mine.signal.aborted) return;
        found.value = [...found.value, answer];
      }
    } catch (error) {
      if (!mine.signal.aborted) fault.value = said(error);
    } finally {
      if (!mine.signal.aborted) waiting.value = false;
    }
  };
  const [only] = found.value;
  const done = found.value.length;
  const several = asks.length > 1;
  return (
    <section class="forecast" aria-live="polite" data-testid="forecast">
      {several && only ? <InAll found={found.value} names={names} waiting={waiting.value} /> : null}
      {!several && only ? <Found view={only} /> : null}
      {fault.value ? (
        <p class="reason alarm" role="alert">
          {several ? `${names[done]}: ` : ""}
          {fault.value}
        </p>
      ) : null}
      {waiting.value ? (
        <p class="hint">
          {several
            ? say("forecast.simulatingOneOf", { name: names[done] ?? "", i: done + 1, n: asks.length })
            : say("forecast.simulatingTheMissionOver")}{" "}
          <Button
            onClick={() => {
              request.current?.abort();
              waiting.value = false;
            }}
          >
            {say("abort.stop")}
          </Button>
        </p>
      ) : done === asks.length ? null : (
        <Button id="ask-forecast" onClick={() => void start()}>
          {done > 0 ? say("forecast.goOn") : say("forecast.forecastByAQuickSimulation")}
        </Button>
      )}
    </section>
  );
}

interface InAllProps {
  found: readonly ForecastView[];
  names: readonly string[];
  waiting: boolean;
}

/** Each block with what is to be expected of it, what was simulated of all, and each one's own figures. */
function InAll({ found, names, waiting }: InAllProps) {
  const missing = say(waiting ? "planned.notYet" : "forecast.notSimulated");
  const all = found.length < names.length ? null : forecastInAll(found);
  return (
    <>
      <h3>{say("forecast.forecastNotMeasured")}</h3>
      <table class="shares in-blocks" data-testid="forecast-in-blocks">
        <thead>
          <tr>
            <th scope="col">{say("blocks.blocks")}</th>
            <th scope="col">{say("forecast.duration")}</th>
            <th scope="col">{knownTitle(found[0])}</th>
          </tr>
        </thead>
        <tbody>
          {names.map((name, i) => (
            <tr key={name} data-testid={`forecast-block-${i + 1}`}>
              <th scope="row">{name}</th>
              <td>{found[i] ? time(found[i].duration_s_range) : missing}</td>
              <td>{found[i] ? between(found[i].coverage_pct_range, percent) : ""}</td>
            </tr>
          ))}
        </tbody>
        <tfoot>
          <tr data-testid="forecast-in-all">
            <th scope="row">{say("blocks.inAll")}</th>
            <td>{all ? time(all.duration_s_range) : missing}</td>
            <td />
          </tr>
        </tfoot>
      </table>
      {all ? <Ways of={all.vehicles} /> : null}
      {found.map((view, i) => (
        <details key={names[i]}>
          <summary>{names[i]}</summary>
          <Figures view={view} />
        </details>
      ))}
    </>
  );
}

const time = (range: { low: number; high: number } | null): string =>
  range === null ? duration(null) : durations(range.low, range.high);

/** "low to high" where they differ as they are shown. */
function between(range: { low: number; high: number } | null, shown: (value: number) => string): string {
  if (range === null) return "–";
  const [low, high] = [shown(range.low), shown(range.high)];
  return low === high ? low : say("forecast.to", { low, high });
}

function Found({ view }: { view: ForecastView }) {
  return (
    <>
      <h3>{say("forecast.forecastNotMeasured")}</h3>
      <Figures view={view} />
    </>
  );
}

/** What the figures hold after, where not all was simulated. */
const simulatedOf = (view: ForecastView): string =>
  view.steps_simulated < view.steps && !view.whole_survey
    ? say("forecast.afterSteps", { stepsSimulated: view.steps_simulated })
    : "";

const knownTitle = (view: ForecastView | undefined): string =>
  view?.whole_survey
    ? say("forecast.ensonified")
    : say("forecast.known", { simulated: view ? simulatedOf(view) : "" });

function Figures({ view }: { view: ForecastView }) {
  const simulated = simulatedOf(view);
  return (
    <>
      <dl class="figures">
        <div class="figure">
          <dt>{say("forecast.duration")}</dt>
          <dd data-testid="forecast-duration">{time(view.duration_s_range)}</dd>
        </div>
        <div class="figure">
          <dt>{knownTitle(view)}</dt>
          <dd data-testid="forecast-coverage">{between(view.coverage_pct_range, percent)}</dd>
        </div>
        {view.whole_survey ? null : (
          <div class="figure">
            <dt>{say("forecast.leftToBeKnown", { simulated })}</dt>
            <dd>{between(view.remaining_pct_range, percent)}</dd>
          </div>
        )}
        <div class="figure">
          <dt>{say("forecast.meanDeviation", { simulated })}</dt>
          <dd>{between(view.mean_sd_m_range, (sd) => metres(sd, 2))}</dd>
        </div>
      </dl>
      <Ways of={view.vehicles} />
      {view.whole_survey ? <WholeSurvey whole={view.whole_survey} /> : null}
      <ul class="hint assumptions">
        {view.assumptions.map((words) => (
          <li key={words}>{words}</li>
        ))}
      </ul>
    </>
  );
}

type Way = Pick<ForecastView["vehicles"][number], "vehicle" | "distance_m_range">;

/** How far each vehicle goes. */
function Ways({ of }: { of: readonly Way[] }) {
  return (
    <p class="hint">{of.map((v) => `${v.vehicle} ${between(v.distance_m_range, distance)}`).join(" · ")}</p>
  );
}
