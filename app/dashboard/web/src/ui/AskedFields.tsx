import "./AskedFields.css";
import { api } from "../api/client";
import SPEC from "../api/mission.json";
import { sizeOf } from "../map/area";
import {
  canPlan,
  cornersOf,
  type Estimate,
  estimate,
  faultsOf,
  type LengthChoice,
  lengthChoiceOf,
  PLANNER_PRESETS,
  toMission,
  withLength,
} from "../state/draft";
import { FIELDS } from "../state/fields";
import { distance, duration, percent } from "../state/format";
import { fleet } from "../state/store";
import { Choice } from "./Controls";
import { Fault, Part, Text, useForm } from "./Fields";
import { Forecast } from "./Forecast";

/** What the survey is to give: how sure, how complete, how long it may take; and what follows from that. */
export function AskedFields() {
  return (
    <fieldset class="asked">
      <legend>What is asked</legend>
      <Quality />
      <Coverage />
      <Length />
      <Expected />
    </fieldset>
  );
}

/** What each order asks for where it is strictest, the most demanding first. */
const ORDERS = Object.entries(SPEC.accuracy_m.orders).sort(([, a], [, b]) => a - b);

/** How sure depths are to be: as an order of S-44 asks, or a deviation of one's own. */
function Quality() {
  const { draft, set } = useForm();
  const order = ORDERS.find(([, sd_m]) => String(sd_m) === draft.accuracy_m)?.[0] ?? "";
  return (
    <div class="pair">
      <label class="field">
        As sure as asked by
        <Choice
          value={order}
          options={[["", "my own figure"], ...ORDERS.map(([name]) => [name, `S-44 ${name}`] as const)]}
          title="The largest vertical uncertainty of IHO S-44 where it is strictest, in water of no depth. A map alone claims no order"
          id="field-order"
          onChoose={(name) => {
            const asked = ORDERS.find(([known]) => known === name);
            set({ accuracy_m: String(asked ? asked[1] : SPEC.accuracy_m.default) });
          }}
        />
      </label>
      <Text
        field="accuracy_m"
        label={`Standard deviation, ${FIELDS.accuracy_m.unit}`}
        hint={SPEC.accuracy_m.description}
        numeric
      />
    </div>
  );
}

/** How the area is covered. */
function Coverage() {
  const { draft, set } = useForm();
  const presets = Object.entries(PLANNER_PRESETS).filter(
    ([name]) => name === draft.planner || canPlan(name, draft),
  );
  return (
    <div role="radiogroup" aria-label="Coverage">
      {presets.map(([name, { title, words }]) => (
        <label key={name} class="preset">
          <input
            type="radio"
            name="planner"
            checked={draft.planner === name}
            data-testid={`planner-${name}`}
            onChange={() => set({ planner: name })}
          />
          <span>
            <b>{title}</b> <small>{words}</small>
          </span>
        </label>
      ))}
      {draft.planner in PLANNER_PRESETS ? null : (
        <p class="hint">Planned by {draft.planner}, see expert settings.</p>
      )}
      {draft.planner === "swath" ? (
        <div class="pair">
          <Part of="coverage" />
        </div>
      ) : null}
      <Fault field="planner" />
    </div>
  );
}

const LENGTHS: readonly (readonly [LengthChoice, string])[] = [
  ["minutes", "minutes at sea"],
  ["km_per_vehicle", "kilometres each"],
  ["spacing_m", "metres between lines"],
  ["steps", "steps"],
];

/** How long the mission is: by a deadline, a way, the distance of lines, or steps. */
function Length() {
  const { draft, set } = useForm();
  const chosen = lengthChoiceOf(draft);
  return (
    <div class="pair">
      {chosen === "spacing_m" ? (
        <Text field="spacing_m" label="Lines apart, m" numeric />
      ) : (
        <Part of="length" />
      )}
      <label class="field">
        Length in
        <Choice
          value={chosen}
          options={LENGTHS}
          id="field-length"
          onChoose={(choice) => set((present) => withLength(choice, present))}
        />
      </label>
    </div>
  );
}

/** What the mission takes at most, drawn anew with every change, and a simulation of it when asked for. */
function Expected() {
  const { draft } = useForm();
  const corners = cornersOf(draft);
  const found = corners.length > 2 ? estimate(draft, sizeOf(corners).area_m2) : null;
  if (!found) return null;
  const whole = Object.keys(faultsOf({ ...draft, name: draft.name || "forecast" })).length === 0;
  return (
    <>
      <p class="hint" data-testid="estimate">
        At most {duration(found.seconds)} and {distance(found.metres)} of tracks, as much as lines{" "}
        {found.spacing_m.toFixed(1)} m apart.
        {found.farthest_m === null ? "" : ` Up to ${distance(found.farthest_m)} from the recovery point.`}
      </p>
      <Shares of={found} />
      {whole ? (
        <Forecast
          of={JSON.stringify(toMission({ ...draft, name: "forecast" }))}
          ask={(gone) => api.forecastOf(toMission({ ...draft, name: draft.name || "forecast" }), gone)}
        />
      ) : null}
    </>
  );
}

const shareOf = (part: number, whole: number) => (part / whole) * PERCENT;
const PERCENT = 100;

/** What each vehicle does at most, beside the energy that it has. */
function Shares({ of: { shares } }: { of: Estimate }) {
  return (
    <table class="shares" data-testid="shares">
      <thead>
        <tr>
          {["Vehicle", "Time", "Length", "Energy"].map((title) => (
            <th key={title} scope="col">
              {title}
            </th>
          ))}
        </tr>
      </thead>
      <tbody>
        {shares.map(({ name, seconds, metres, endurance_s }) => {
          const battery_pct = fleet.value.find((v) => v.name === name)?.battery_pct ?? null;
          const full = endurance_s !== null && seconds > endurance_s;
          return (
            <tr key={name} data-testid={`share-${name}`} class={full ? "short" : ""}>
              <th scope="row">{name}</th>
              <td>{duration(seconds)}</td>
              <td>{distance(metres)}</td>
              <td>
                {endurance_s !== null
                  ? `${full ? "▲ " : ""}${percent(shareOf(seconds, endurance_s))} of its endurance`
                  : battery_pct !== null
                    ? `battery ${percent(battery_pct)}`
                    : "not known"}
              </td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}
