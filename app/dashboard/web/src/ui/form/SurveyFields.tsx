import "./SurveyFields.css";
import { api, type Described } from "../../api/client";
import SPEC from "../../api/mission.json";
import type { PlanView } from "../../api/types";
import { sizeOf } from "../../map/area";
import { comingFrom, toMissions } from "../../state/form/blocks";
import {
  allBlocks,
  blockTitle,
  canPlan,
  cornersOf,
  type Draft,
  estimate,
  faultsOf,
  type LengthChoice,
  lengthChoiceOf,
  PLANNER_PRESETS,
  withLength,
} from "../../state/form/draft";
import { FIELDS } from "../../state/form/missionFields";
import {
  EVEN_LINES,
  endsWithLines,
  fliesCrosslines,
  LINE_HEADING,
  linesOf,
  shownOptions,
  withPlanner,
} from "../../state/form/plannerOptions";
import { distance, duration, fixed } from "../../state/format";
import { planned } from "../../state/store";
import { say } from "../../words/say";
import { Forecast } from "../forecast/Forecast";
import { Planned, usePlan } from "../forecast/Planned";
import { Choice } from "../parts/Controls";
import { Fault, Part, Text, useForm } from "./Fields";
import { LineFields } from "./LineFields";
import { PlannerOptionFields } from "./PlannerOptionFields";

/** What the survey is to give: how sure, how complete, how long it may take; and what follows from that. */
export function SurveyFields() {
  return (
    <fieldset class="asked">
      <legend>{say("asked.whatIsAsked")}</legend>
      <Quality />
      <SurveyLines />
      <Length />
      <Expected />
    </fieldset>
  );
}

const STRICTEST_M = Object.entries<number>(SPEC.accuracy_m.orders);

/** What orders ask for where they are strictest, the most demanding first; those that ask for the same are one choice. */
const ORDERS = [...new Set(STRICTEST_M.map(([, sd_m]) => sd_m))]
  .sort((a, b) => a - b)
  .map((figure) => {
    const alike = STRICTEST_M.filter(([, sd_m]) => sd_m === figure);
    return [alike.map(([name]) => name).join(", "), figure] as const;
  });

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

/** How lines are laid over the area. */
function SurveyLines() {
  const { draft, planners, set } = useForm();
  const presets = Object.entries(PLANNER_PRESETS).filter(
    ([name]) => name === draft.planner || canPlan(name, draft),
  );
  return (
    <div role="radiogroup" aria-label={say("asked.surveyLines")}>
      {presets.map(([name, { title, words }]) => (
        <label key={name} class="preset">
          <input
            type="radio"
            name="planner"
            checked={draft.planner === name}
            data-testid={`planner-${name}`}
            onChange={() => set((present) => withPlanner(name, present, planners))}
          />
          <span>
            <b>{title}</b> <small>{words}</small>
          </span>
        </label>
      ))}
      {draft.planner in PLANNER_PRESETS ? null : (
        <p class="hint">{say("asked.plannedBySeeExpertSettings", { planner: draft.planner })}</p>
      )}
      {fliesCrosslines(draft) ? (
        <div class="pair">
          {draft.planner === "swath" ? <Part of="coverage" /> : null}
          <Part of="crosslines" />
        </div>
      ) : null}
      {shownOptions(draft, planners).includes(LINE_HEADING) ? (
        <PlannerOptionFields names={[LINE_HEADING]} />
      ) : null}
      {draft.planner === EVEN_LINES ? <LineFields /> : null}
      <Fault field="planner" />
    </div>
  );
}

const lengths = (draft: Draft): readonly (readonly [LengthChoice, string])[] => [
  ["minutes", say("asked.minutesAtSea")],
  ["km_per_vehicle", say("asked.kilometresEach")],
  linesOf(draft).length > 0
    ? ["lines", say("asked.untilAllLinesAreFlown")]
    : ["spacing_m", say("asked.metresBetweenLines")],
  ["steps", say("asked.steps")],
];

/** How long the mission is: by a deadline, a way, the distance of lines, or steps. */
function Length() {
  const { draft, set } = useForm();
  const chosen = lengthChoiceOf(draft);
  return (
    <div class={chosen === "lines" ? "" : "pair"}>
      {chosen === "lines" ? null : chosen === "spacing_m" ? (
        <Text field="spacing_m" label={say("asked.linesApartM")} numeric />
      ) : (
        <Part of="length" />
      )}
      <label class="field">
        {say("asked.lengthIn")}
        <Choice
          value={chosen}
          options={lengths(draft)}
          id="field-length"
          onChoose={(choice) => set((present) => withLength(choice, present))}
        />
      </label>
    </div>
  );
}

/** By what was planned, if that is known, where the vehicles come from into a block. */
function planBefore(block: number): PlanView | undefined {
  const { plans, fresh } = planned.peek() ?? { plans: [], fresh: 0 };
  return block > fresh ? undefined : plans[block - 1];
}

/** What the mission takes at most, its plan drawn anew with every change, and a simulation of it when asked for. */
function Expected() {
  const { draft } = useForm();
  const corners = cornersOf(draft);
  const found = corners.length > 2 ? estimate(draft, sizeOf(corners).area_m2) : null;
  const whole =
    found !== null && Object.keys(faultsOf({ ...draft, name: draft.name || "forecast" })).length === 0;
  const { floor_depth_m } = draft;
  const described = whole
    ? toMissions({ ...draft, name: "forecast" }).map((mission): Described => ({ mission, floor_depth_m }))
    : [];
  const mine = whole ? JSON.stringify(described) : null;
  const fault = usePlan(mine);
  const names = allBlocks(draft).map(blockTitle);
  if (!found) return null;
  return (
    <>
      <div class="explained">
        <Text
          field="floor_depth_m"
          label={say("asked.depthOfTheBottomM")}
          placeholder={say("asked.aGuess")}
          numeric
        />
        <small>{SPEC.floor_depth_m.description}</small>
      </div>
      <p class="hint" data-testid="estimate">
        {say(endsWithLines(draft) ? "asked.untilLinesAreFlown" : "asked.atMostAndOfTracksAs", {
          seconds: duration(found.seconds),
          metres: distance(found.metres),
          spacingM: fixed(found.spacing_m, 1),
          it:
            found.farthest_m === null
              ? ""
              : say("asked.upToFromTheRecoveryPoint", { farthestM: distance(found.farthest_m) }),
        })}
      </p>
      <Planned of={found} name={draft.name} names={names} turn={draft.turn} fault={fault} />
      {mine ? (
        <Forecast
          of={mine}
          names={names}
          asks={described.map(
            (one, i) => (gone) =>
              api.forecastOf({ ...one, mission: comingFrom(planBefore(i), one.mission) }, gone),
          )}
        />
      ) : null}
    </>
  );
}
