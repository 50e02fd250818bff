import "./NewMissionForm.css";
import { useSignal, useSignalEffect } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api, ServiceError } from "../api/client";
import type { PlannerView } from "../api/types";
import { polygonOf, sizeOf } from "../map/area";
import type { PlaceMark } from "../map/marks";
import { recoveryMarks } from "../map/recovery";
import {
  areaOf,
  canPlan,
  copyOf,
  cornersOf,
  type Draft,
  emptyDraft,
  estimate,
  type Faults,
  faultsOf,
  fieldOf,
  PLANNER_PRESETS,
  toMission,
  turnedInto,
  vehicleNames,
} from "../state/draft";
import { distance, duration } from "../state/format";
import { placeOf } from "../state/place";
import { createMission, said } from "../state/session";
import { copied, describing, draftShapes, drawing, mapCentre, picking } from "../state/store";
import { AreaFields } from "./AreaFields";
import { Button, Choice, FileButton, same, useEscape } from "./Controls";
import { Fault, Form, type FormState, Part, PlaceField, Text, useForm } from "./Fields";
import { Forecast } from "./Forecast";
import { SearchFields } from "./SearchFields";
import { SiteFields } from "./SiteFields";
import { VehicleFields } from "./VehicleFields";

export function NewMissionForm() {
  const original = copied.peek();
  const draft = useSignal(original ? copyOf(original) : emptyDraft(mapCentre.peek()));
  const faults = useSignal<Faults>({});
  const refused = useSignal<ServiceError | null>(null);
  const sending = useSignal(false);

  useSignalEffect(() => {
    draftShapes.value = {
      area: areaOf(draft.value),
      keepOut: draft.value.keepOut.filter((zone) => zone.length > 2).map(polygonOf),
      marks: draftMarks(draft.value),
    };
  });
  useEscape(drawing);
  useEscape(picking);
  useEffect(
    () => () => {
      draftShapes.value = null;
    },
    [],
  );

  const close = () => {
    describing.value = false;
    copied.value = null;
  };
  const set: FormState["set"] = (how) => {
    const change = typeof how === "function" ? how(draft.value) : how;
    draft.value = { ...draft.value, ...change };
    const found = faultsOf(draft.value);
    // What was drawn is judged at once, typed fields only after the first try.
    if (Object.keys(faults.value).length > 0) faults.value = found;
    else if (change.ring || change.keepOut) {
      const { ring, keepOut } = found;
      faults.value = { ...(ring ? { ring } : {}), ...(keepOut ? { keepOut } : {}) };
    }
  };
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    faults.value = faultsOf(draft.value);
    refused.value = null;
    if (Object.keys(faults.value).length > 0) return;
    sending.value = true;
    try {
      const id = await createMission(toMission(draft.value));
      if (draft.value.tide_table) {
        await api.setTide(id, {
          table: draft.value.tide_table,
          source: draft.value.tide_source || "tide table",
        });
      }
      close();
    } catch (error) {
      if (!(error instanceof ServiceError)) throw error;
      refused.value = error;
      for (const { field, message, expected } of error.faults) {
        const own = fieldOf(field);
        if (own)
          faults.value = { ...faults.value, [own]: [message, expected].filter(Boolean).join("; expected ") };
      }
    } finally {
      sending.value = false;
    }
  };
  return (
    <Form.Provider value={{ draft: draft.value, faults: faults.value, set }}>
      <form
        class="new-mission"
        onSubmit={(event) => void submit(event)}
        noValidate
        data-testid="mission-form"
      >
        <header class="panel-head">
          <h2>{original ? "Copy of a mission" : "New mission"}</h2>
          <Button onClick={close}>Cancel</Button>
        </header>
        <Text field="name" label="Name" placeholder="Leixões quay" />
        <Kind />
        <AreaFields />
        {draft.value.kind === "survey" ? <SiteFields /> : null}
        <VehicleFields />
        <RecoveryFields />
        {draft.value.kind === "search" ? (
          <SearchFields />
        ) : (
          <>
            <Planner />
            <Length />
            <Expected />
          </>
        )}
        <details>
          <summary>Limits and grid</summary>
          <div class="pair">
            <Part of="limits" />
          </div>
        </details>
        {draft.value.kind === "survey" ? (
          <details>
            <summary>Uncertainty of swath sonars</summary>
            <div class="pair">
              <Part of="uncertainty" />
            </div>
          </details>
        ) : null}
        <details>
          <summary>Tide</summary>
          <div class="pair">
            <Part of="tide" />
            <Text field="tide_source" label="From where" placeholder="gauge" />
          </div>
          <FileButton
            accept=".tid,.txt"
            id="tide-file"
            onText={(name, text) => set({ tide_table: text, tide_source: name })}
          >
            {draft.value.tide_table ? `Table: ${draft.value.tide_source}` : "Table (.tid)"}
          </FileButton>
          <p class="hint">Tides can be set and changed at any time; soundings keep their raw values.</p>
        </details>
        {refused.value ? (
          <p class="reason alarm" role="alert">
            {said(refused.value)}
          </p>
        ) : null}
        <button
          type="submit"
          class="command primary wide"
          disabled={sending.value}
          data-testid="create-mission"
        >
          {sending.value ? "Creating…" : "Create mission"}
        </button>
      </form>
    </Form.Provider>
  );
}

/** To map the sea floor, or to look for something among obstacles. */
function Kind() {
  const { draft, set } = useForm();
  const choice = (kind: Draft["kind"], title: string, words: string) => (
    <label class="preset">
      <input
        type="radio"
        name="kind"
        checked={draft.kind === kind}
        data-testid={`kind-${kind}`}
        onChange={() => set(turnedInto(kind, draft))}
      />
      <span>
        <b>{title}</b> <small>{words}</small>
      </span>
    </label>
  );
  return (
    <fieldset class="planner">
      <legend>What for</legend>
      {choice("survey", "Survey", "Map the sea floor of the area.")}
      {choice("search", "Search", "Look for something in a partly known site, and be back in time.")}
    </fieldset>
  );
}

/** Places of a mission that is being described, as far as they are given. */
function draftMarks(draft: Draft): PlaceMark[] {
  const length_m = (text: string) => (Number(text) > 0 ? Number(text) : 0);
  const [goal, entry, point] = [placeOf(draft.goal), placeOf(draft.entry), placeOf(draft.recovery)];
  const radius_m = length_m(draft.recovery_radius_m);
  const vehicles = vehicleNames(draft).map((name) => ({
    name,
    recovery_point: placeOf(draft.own[name]?.recovery_point ?? ""),
  }));
  const homes = recoveryMarks({ recovery: point && { point, radius_m }, vehicles }, radius_m);
  if (draft.kind !== "search") return homes;
  return [
    ...homes,
    ...(goal
      ? [{ words: "Goal", sign: "goal" as const, at: goal, radius_m: length_m(draft.goal_radius_m) }]
      : []),
    ...(entry ? [{ words: "Entry", sign: "entry" as const, at: entry, radius_m: 0 }] : []),
  ];
}

/** Where vehicles come home to, and what sends them there. */
function RecoveryFields() {
  const { draft } = useForm();
  return (
    <fieldset>
      <legend>Recovery</legend>
      <PlaceField field="recovery" label="Recovery point" />
      {draft.recovery.trim() === "" ? (
        <p class="hint">Without one vehicles stop and come up where they are.</p>
      ) : (
        <div class="pair">
          <Part of="recovery" />
        </div>
      )}
    </fieldset>
  );
}

const LENGTHS = [
  ["steps", "steps"],
  ["minutes", "minutes"],
  ["km_per_vehicle", "kilometres"],
] as const;

/** How long the mission is, in the unit of the operator's choice. */
function Length() {
  const { draft, set } = useForm();
  return (
    <div class="pair">
      <Part of="length" />
      <label class="field">
        Length in
        <Choice
          value={draft.length}
          options={LENGTHS}
          id="field-length"
          onChoose={(length) => set({ length })}
        />
      </label>
    </div>
  );
}

/** How long it takes at most and how dense it gets, before anything is created. */
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
      </p>
      {whole ? (
        <Forecast
          of={JSON.stringify(toMission({ ...draft, name: "forecast" }))}
          ask={(gone) => api.forecastOf(toMission({ ...draft, name: draft.name || "forecast" }), gone)}
        />
      ) : null}
    </>
  );
}

function Planner() {
  const { draft, set } = useForm();
  const planners = useSignal<readonly PlannerView[]>([]);
  const fault = useSignal("");
  useEffect(() => {
    api.planners().then(
      (list) => {
        planners.value = list;
      },
      (error: unknown) => {
        fault.value = said(error);
      },
    );
  }, []);
  const presets = Object.entries(PLANNER_PRESETS).filter(
    ([name]) => name === draft.planner || canPlan(name, draft),
  );
  const usable = planners.value.filter((p) => !p.problem);
  const broken = planners.value.filter((p) => p.problem);
  const others = usable.filter((p) => !(p.name in PLANNER_PRESETS));
  const other = others.find((p) => p.name === draft.planner);
  return (
    <fieldset class="planner">
      <legend>Planner</legend>
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
      {draft.planner === "swath" ? (
        <div class="pair">
          <Part of="coverage" />
        </div>
      ) : null}
      <details>
        <summary>More planners and their settings</summary>
        <label class="field">
          Planner
          <Choice
            value={draft.planner}
            options={same(usable.length > 0 ? usable.map((p) => p.name) : [draft.planner])}
            id="field-planner"
            onChoose={(planner) => set({ planner })}
          />
          {other ? (
            <small>
              {other.summary} ({other.package})
            </small>
          ) : null}
        </label>
        {broken.map((p) => (
          <small key={p.name} class="fault" data-testid={`broken-planner-${p.name}`}>
            ▲ {p.name} of {p.package} cannot be used: {p.problem}
          </small>
        ))}
        <Options schema={planners.value.find((p) => p.name === draft.planner)?.options} />
      </details>
      {fault.value ? <span class="fault">▲ {fault.value}</span> : null}
      <Fault field="planner" />
    </fieldset>
  );
}

interface OptionSchema {
  description?: string;
  default?: unknown;
  type?: string;
  enum?: string[];
  anyOf?: { type?: string; $ref?: string }[];
}

/** The planner's settings as the service declares them; an empty field takes the default. */
function Options({ schema }: { schema: Record<string, unknown> | undefined }) {
  const { draft, set } = useForm();
  const all = Object.entries((schema?.properties ?? {}) as Record<string, OptionSchema>);
  // A whole document, such as a trained model, is no field of a form: it comes by REST.
  const properties = all.filter(([, option]) => !option.anyOf?.some((kind) => kind.$ref));
  const change = (name: string, value: unknown) => {
    const { [name as keyof typeof draft.options]: _, ...rest } = draft.options;
    set({ options: value === undefined ? rest : { ...rest, [name]: value } });
  };
  return (
    <div class="options">
      {properties.map(([name, option]) => (
        <div key={name} class="field">
          <label for={`option-${name}`}>{name.replaceAll("_", " ")}</label>
          {option.enum ? (
            <select
              id={`option-${name}`}
              value={String(draft.options[name as keyof typeof draft.options] ?? option.default)}
              onChange={(event) => change(name, event.currentTarget.value)}
            >
              {option.enum.map((value) => (
                <option key={value}>{value}</option>
              ))}
            </select>
          ) : (
            <input
              id={`option-${name}`}
              type="text"
              inputMode="decimal"
              placeholder={option.default === null ? "automatic" : String(option.default)}
              onInput={(event) => {
                const text = event.currentTarget.value.trim();
                change(name, text === "" || !Number.isFinite(Number(text)) ? undefined : Number(text));
              }}
            />
          )}
          <small>{option.description}</small>
        </div>
      ))}
    </div>
  );
}
