import "./Compare.css";
import { useSignal, useSignalEffect } from "@preact/signals";
import { api } from "../../api/client";
import type { MissionView, StepView } from "../../api/types";
import { differenceOf, type SeaFloor, withTiles } from "../../map/picture/seafloor";
import { count, dayAndTime, distance, duration, metres, percent } from "../../state/format";
import { figuresOf } from "../../state/past/history";
import { fetchSteps, noteFault, said } from "../../state/session";
import { lengthWords, MISSION_WORDS } from "../../state/stateNames";
import { mission, missions, seaFloor, selectedId, steps } from "../../state/store";
import { say } from "../../words/say";
import { Choice } from "../parts/Controls";
import { Plot } from "../parts/Plot";

interface Other {
  mission: MissionView;
  steps: readonly StepView[];
  map: SeaFloor | null;
}

/** This mission beside another one: figures, their course over the steps, and how the maps differ. */
export function Compare() {
  const chosen = useSignal("");
  const other = useSignal<Other | null>(null);
  const fault = useSignal("");
  useSignalEffect(() => {
    const id = chosen.value;
    const of = selectedId.value;
    other.value = null;
    if (!id) return;
    if (id === of) {
      // It was compared with another one before.
      chosen.value = "";
      return;
    }
    fetchSteps().catch(noteFault);
    fetchOther(id).then(
      (found) => {
        if (chosen.peek() === id) other.value = found;
      },
      (error) => {
        fault.value = said(error);
      },
    );
  });
  const present = mission.value;
  if (!present) return null;
  const found = other.value;
  return (
    <div class="log compare" data-testid="compare">
      <label class="field">
        {say("compare.compareWith")}
        <Choice
          value={chosen.value}
          options={[
            ["", say("compare.chooseAMission")],
            ...(missions.value ?? [])
              .filter((m) => m.id !== present.id)
              .map(
                (m) =>
                  [
                    m.id,
                    `${m.name}, ${MISSION_WORDS[m.state].toLowerCase()}, ${dayAndTime(new Date(m.created_at))}`,
                  ] as const,
              ),
          ]}
          id="compare-with"
          onChoose={(id) => {
            fault.value = "";
            chosen.value = id;
          }}
        />
      </label>
      {fault.value ? (
        <p class="alarm" role="alert">
          ✕ {fault.value}
        </p>
      ) : null}
      {found ? <Both one={present} other={found} /> : null}
    </div>
  );
}

async function fetchOther(id: string): Promise<Other> {
  const mission = await api.mission(id);
  const steps: StepView[] = [];
  for (;;) {
    const more = await api.steps(id, steps.at(-1)?.number ?? 0);
    steps.push(...more);
    if (more.length < 1000) break;
  }
  const { soundings, coverage_pct, mean_sd_m } = mission.progress;
  const mapped = soundings > 0 || coverage_pct > 0 || mean_sd_m !== null;
  const map = mapped ? withTiles(null, await api.mapTiles(id, "", [], null)) : null;
  return { mission, steps, map };
}

type Row = [string, (m: MissionView) => string];

/** How much each covers: what is ensonified is another thing than what is known to an accuracy. */
function coverageRows(missions: readonly MissionView[]): Row[] {
  const swept = ({ progress }: MissionView) => progress.ensonified_pct !== null;
  const known: Row = [
    say("compare.knownToTheAskedAccuracy"),
    (m) => percent(swept(m) ? null : m.progress.coverage_pct, 1),
  ];
  const ensonified: Row[] = [
    [say("bottomStrip.ensonified"), (m) => percent(m.progress.ensonified_pct, 1)],
    [say("compare.dense"), (m) => percent(m.progress.dense_pct, 1)],
    [say("bottomStrip.holidays"), (m) => (m.progress.holidays === null ? "–" : count(m.progress.holidays))],
  ];
  return [...(missions.every(swept) ? [] : [known]), ...(missions.some(swept) ? ensonified : [])];
}

function Both({ one, other }: { one: MissionView; other: Other }) {
  const two = other.mission;
  const difference = seaFloor.value && other.map ? differenceOf(seaFloor.value, other.map) : null;
  const rows: Row[] = [
    [say("compare.state"), (m) => MISSION_WORDS[m.state]],
    [say("compare.planner"), (m) => m.spec.planner.name],
    [say("compare.vehicles"), (m) => String(m.vehicles.length)],
    [say("asked.length"), (m) => lengthWords(m.progress)],
    ...coverageRows([one, two]),
    [say("compare.leftToBeKnown"), (m) => percent(m.progress.remaining_pct, 1)],
    [say("bottomStrip.meanDeviation"), (m) => metres(m.progress.mean_sd_m, 3)],
    [say("bottomStrip.soundings"), (m) => count(m.progress.soundings)],
    [say("compare.rejected"), (m) => count(m.progress.rejected)],
    [say("bottomStrip.travelled"), (m) => distance(m.progress.distance_m)],
    [say("asked.time"), (m) => duration(m.progress.elapsed_s)],
  ];
  const a = figuresOf(steps.value);
  const b = figuresOf(other.steps);
  const xs = a.numbers.length >= b.numbers.length ? a.numbers : b.numbers;
  return (
    <>
      <table data-testid="compare-table">
        <thead>
          <tr>
            <th scope="col">{say("compare.figure")}</th>
            <th scope="col">{one.name}</th>
            <th scope="col">{two.name}</th>
          </tr>
        </thead>
        <tbody>
          {rows.map(([label, of]) => (
            <tr key={label}>
              <th scope="row">{label}</th>
              <td>{of(one)}</td>
              <td>{of(two)}</td>
            </tr>
          ))}
        </tbody>
      </table>
      <p data-testid="compare-maps">
        {difference
          ? say("compare.whereBothKnowTheBottomCells", {
              cells: count(difference.cells),
              rmseM: metres(difference.rmse_m, 3),
            }) +
            say("compare.onAverageAtMost", {
              biasM: metres(difference.bias_m, 3),
              largestM: metres(difference.largest_m, 2),
            })
          : say("compare.theMapsDoNotOverlapOr")}
      </p>
      <div class="charts">
        <Plot
          title={say("compare.leftToBeKnown")}
          xs={xs}
          unit="%"
          range={[0, 100]}
          lines={[
            { label: one.name, colour: "#2f7fc1", values: a.remaining },
            { label: two.name, colour: "#c1592f", dash: [6, 4], values: b.remaining },
          ]}
        />
        <Plot
          title={say("charts.meanDeviationOfTheMap")}
          xs={xs}
          unit="m"
          lines={[
            { label: one.name, colour: "#2f7fc1", values: a.deviation },
            { label: two.name, colour: "#c1592f", dash: [6, 4], values: b.deviation },
          ]}
        />
      </div>
    </>
  );
}
