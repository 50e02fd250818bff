import "./SurveyFields.css";
import { api } from "../../api/client";
import SPEC from "../../api/mission.json";
import { sizeOf } from "../../map/area";
import { blockTitle, toMissions } from "../../state/form/blocks";
import {
  allBlocks,
  canPlan,
  cornersOf,
  estimate,
  faultsOf,
  type LengthChoice,
  lengthChoiceOf,
  PLANNER_PRESETS,
  toMission,
  withLength,
} from "../../state/form/draft";
import { FIELDS } from "../../state/form/missionFields";
import { distance, duration, fixed } from "../../state/format";
import { say } from "../../words/say";
import { Forecast } from "../forecast/Forecast";
import { Planned, usePlan } from "../forecast/Planned";
import { Choice } from "../parts/Controls";
import { Fault, Part, Text, useForm } from "./Fields";

/** What the survey is to give: how sure, how complete, how long it may take; and what follows from that. */
export function SurveyFields() {
  return (
    <fieldset class="asked">
      <legend>{say("asked.whatIsAsked")}</legend>
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
        {say("asked.asSureAsAskedBy")}
        <Choice
          value={order}
          options={[
            ["", say("asked.myOwnFigure")],
            ...ORDERS.map(([name]) => [name, `S-44 ${name}`] as const),
          ]}
          title={say("asked.theLargestVertical")}
          id="field-order"
          onChoose={(name) => {
            const asked = ORDERS.find(([known]) => known === name);
            set({ accuracy_m: String(asked ? asked[1] : SPEC.accuracy_m.default) });
          }}
        />
      </label>
      <Text
        field="accuracy_m"
        label={say("asked.standardDeviation", { unit: FIELDS.accuracy_m.unit })}
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
    <div role="radiogroup" aria-label={say("asked.coverage")}>
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
        <p class="hint">{say("asked.plannedBySeeExpertSettings", { planner: draft.planner })}</p>
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

const lengths = (): readonly (readonly [LengthChoice, string])[] => [
  ["minutes", say("asked.minutesAtSea")],
  ["km_per_vehicle", say("asked.kilometresEach")],
  ["spacing_m", say("asked.metresBetweenLines")],
  ["steps", say("asked.steps")],
];

/** How long the mission is: by a deadline, a way, the distance of lines, or steps. */
function Length() {
  const { draft, set } = useForm();
  const chosen = lengthChoiceOf(draft);
  return (
    <div class="pair">
      {chosen === "spacing_m" ? (
        <Text field="spacing_m" label={say("asked.linesApartM")} numeric />
      ) : (
        <Part of="length" />
      )}
      <label class="field">
        {say("asked.lengthIn")}
        <Choice
          value={chosen}
          options={lengths()}
          id="field-length"
          onChoose={(choice) => set((present) => withLength(choice, present))}
        />
      </label>
    </div>
  );
}

/** What the mission takes at most, its plan drawn anew with every change, and a simulation of it when asked for. */
function Expected() {
  const { draft } = useForm();
  const corners = cornersOf(draft);
  const found = corners.length > 2 ? estimate(draft, sizeOf(corners).area_m2) : null;
  const whole =
    found !== null && Object.keys(faultsOf({ ...draft, name: draft.name || "forecast" })).length === 0;
  const mine = whole ? JSON.stringify(toMission({ ...draft, name: "forecast" })) : null;
  const fault = usePlan(whole ? JSON.stringify(toMissions({ ...draft, name: "forecast" })) : null);
  if (!found) return null;
  return (
    <>
      <p class="hint" data-testid="estimate">
        {say("asked.atMostAndOfTracksAs", {
          seconds: duration(found.seconds),
          metres: distance(found.metres),
          spacingM: fixed(found.spacing_m, 1),
          it:
            found.farthest_m === null
              ? ""
              : say("asked.upToFromTheRecoveryPoint", { farthestM: distance(found.farthest_m) }),
        })}
      </p>
      <Planned of={found} names={allBlocks(draft).map(blockTitle)} turn={draft.turn} fault={fault} />
      {mine ? (
        <Forecast
          of={mine}
          ask={(gone) => api.forecastOf(toMission({ ...draft, name: draft.name || "forecast" }), gone)}
        />
      ) : null}
    </>
  );
}
