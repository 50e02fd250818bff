import "./NewMissionForm.css";
import { useSignal, useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { api, ServiceError } from "../../api/client";
import type { LngLat, NewMission, PlannerView } from "../../api/types";
import { polygonOf } from "../../map/area";
import { boundsOf } from "../../map/geo";
import { namedLines } from "../../map/marks/lines";
import type { PlaceMark } from "../../map/marks/marks";
import { recoveryMarks } from "../../map/marks/recovery";
import { placeOf } from "../../state/coordinates";
import { faultInBlock, flownBlocks, toMissions } from "../../state/form/blocks";
import {
  blockTitle,
  copyOf,
  type Draft,
  draftFrom,
  emptyDraft,
  type FaultKey,
  type Faults,
  faultsOf,
  fieldOf,
  hasDaysWater,
  toMission,
  turnedInto,
  vehicleNames,
} from "../../state/form/draft";
import { linesOf } from "../../state/form/plannerOptions";
import { createMissions, describeMission, said } from "../../state/session";
import {
  copied,
  describedDepths,
  describing,
  draftShapes,
  drawing,
  editedMission,
  floorDepth,
  mapCentre,
  picking,
} from "../../state/store";
import { say } from "../../words/say";
import { AskedTwice, FileButton, into, useEscape } from "../parts/Controls";
import { AreaFields } from "./AreaFields";
import { BlockFields } from "./BlockFields";
import { ExpertFields } from "./ExpertFields";
import { Form, type FormState, Part, PlaceField, Text, useForm } from "./Fields";
import { Keeping, MissionTemplates } from "./MissionTemplates";
import { SearchFields } from "./SearchFields";
import { SiteFields } from "./SiteFields";
import { SurveyFields } from "./SurveyFields";
import { VehicleFields } from "./VehicleFields";

export function NewMissionForm() {
  const original = copied.peek();
  const edited = editedMission.peek();
  const draft = useSignal(
    edited
      ? { ...draftFrom(edited), floor_depth_m: floorDepth.peek() }
      : original
        ? copyOf(original)
        : emptyDraft(mapCentre.peek()),
  );
  const begun = useRef(JSON.stringify(draft.peek()));
  const isChanged = () => JSON.stringify(draft.peek()) !== begun.current;
  const faults = useSignal<Faults>({});
  const refused = useSignal<ServiceError | null>(null);
  const planners = useSignal<readonly PlannerView[]>([]);
  const plannersFault = useSignal("");
  useEffect(() => {
    api.planners().then(into(planners), (error: unknown) => {
      plannersFault.value = said(error);
    });
  }, []);
  /** What is sent can be withdrawn until it has arrived; null: nothing is. */
  const sending = useSignal<AbortController | null>(null);
  const form = useRef<HTMLFormElement>(null);
  /** How often it was sent and not taken. */
  const faulty = useSignal(0);
  const unplaced = useSignal<readonly FaultKey[]>([]);
  // After the next picture: parts of the form that do not read its faults themselves show theirs later than the form.
  useEffect(() => {
    const found = form.current ? unplacedIn(form.current, faults.value) : [];
    if (found.join() !== unplaced.peek().join()) unplaced.value = found;
  }, [faults.value, draft.value]);
  useEffect(() => {
    if (faulty.value > 0 && form.current) showFault(form.current);
  }, [faulty.value]);

  useSignalEffect(() => {
    draftShapes.value = {
      areas: flownBlocks(draft.value)
        .filter(({ ring }) => ring.length > 2)
        .map(({ ring }) => polygonOf(ring)),
      keepOut: draft.value.keepOut.filter((zone) => zone.length > 2).map(polygonOf),
      lines: namedLines(linesOf(draft.value)),
      marks: draftMarks(draft.value),
    };
  });
  useEscape(drawing, null);
  useEscape(picking, null);
  useEffect(() => {
    const ask = (event: BeforeUnloadEvent) => {
      if (isChanged()) event.preventDefault();
    };
    window.addEventListener("beforeunload", ask);
    return () => {
      window.removeEventListener("beforeunload", ask);
      draftShapes.value = null;
    };
  }, []);

  const close = () => {
    sending.peek()?.abort();
    describing.value = false;
    copied.value = null;
    editedMission.value = null;
  };
  /** Begins with what a file or a template says. */
  const begin = (next: Draft) => {
    draft.value = next;
    faults.value = {};
    refused.value = null;
  };
  const set: FormState["set"] = (how) => {
    const change = typeof how === "function" ? how(draft.value) : how;
    draft.value = { ...draft.value, ...change };
    refused.value = null;
    const found = faultsOf(draft.value);
    // What was drawn, and vehicles' names, are judged at once, other fields only after the first try.
    if (Object.keys(faults.value).length > 0) faults.value = found;
    else if (change.ring || change.keepOut || change.wanted) {
      const { ring, keepOut, names } = found;
      const atOnce = Object.entries({ ring, keepOut, names }).filter(([, fault]) => fault);
      faults.value = Object.fromEntries(atOnce);
    }
  };
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    if (sending.peek()) return;
    faults.value = faultsOf(draft.value);
    refused.value = null;
    if (Object.keys(faults.value).length > 0) {
      faulty.value += 1;
      return;
    }
    const sent = new AbortController();
    sending.value = sent;
    let taken = 0;
    try {
      const { tide_table: table, tide_source, floor_depth_m } = draft.value;
      const source = tide_source || say("mission.tideTable");
      const withTide = async (id: string) => {
        if (table) await api.setTide(id, { table, source });
        taken += 1;
      };
      if (edited) {
        // What it follows stays as it is.
        await describeMission(edited.id, { ...toMission(draft.value), after: edited.after });
        await withTide(edited.id);
        floorDepth.value = floor_depth_m;
      } else {
        const made = await createMissions(toMissions(draft.value), withTide, sent.signal);
        for (const id of made) describedDepths.set(id, floor_depth_m);
      }
      if (!sent.signal.aborted) close();
    } catch (error) {
      if (sent.signal.aborted) return;
      if (!(error instanceof ServiceError)) throw error;
      refused.value = error;
      for (const { field, message, expected } of error.faults) {
        const words = [message, expected].filter(Boolean).join(say("mission.expected"));
        const [key, fault] = faultInBlock(fieldOf(field, draft.value), words, draft.value, taken);
        faults.value = { ...faults.value, [key]: fault };
      }
      faulty.value += 1;
    } finally {
      sending.value = null;
    }
  };
  return (
    <Form.Provider value={{ draft: draft.value, faults: faults.value, planners: planners.value, set }}>
      <header class="panel-head">
        <h2 tabIndex={-1}>
          {edited
            ? say("mission.editAMission")
            : original
              ? say("missions.sameAgain")
              : say("mission.newMission")}
        </h2>
        <Cancel isChanged={isChanged} isSaving={edited !== null && sending.value !== null} onCancel={close} />
      </header>
      <form
        ref={form}
        class="new-mission"
        // What is being sent stays as it is.
        inert={sending.value !== null}
        onSubmit={(event) => void submit(event)}
        noValidate
        data-testid="mission-form"
      >
        {edited ? (
          <p class="hint">{say("mission.itKeepsItsNumber")}</p>
        ) : (
          <MissionTemplates draft={draft.value} onBegin={begin} />
        )}
        <Text field="name" label={say("mission.name")} placeholder={say("mission.leixEsQuay")} />
        <Kind />
        {draft.value.kind === "survey" ? <SurveyFields /> : null}
        <AreaFields />
        {draft.value.kind === "survey" && !edited ? <BlockFields /> : null}
        {draft.value.kind === "search" && draft.value.blocks.length > 0 ? (
          <p class="hint" role="status" data-testid="blocks-left-out">
            {say("blocks.leftOut", { others: draft.value.blocks.length })}
          </p>
        ) : null}
        {draft.value.kind === "survey" ? <SiteFields /> : null}
        {draft.value.kind === "search" ? <SearchFields /> : null}
        <VehicleFields />
        <RecoveryFields />
        <ExpertFields fault={plannersFault.value} />
        {original && hasDaysWater(original.spec as Partial<NewMission>) ? (
          <p class="hint" data-testid="days-water">
            {say("mission.castsAndLevelsStay")}
          </p>
        ) : null}
        <details>
          <summary>{say("mission.tide")}</summary>
          <div class="pair">
            <Part of="tide" />
            <Text field="tide_source" label={say("mission.fromWhere")} placeholder={say("mission.gauge")} />
          </div>
          <FileButton
            accept=".tid,.txt,.csv,.tsv"
            id="tide-file"
            onText={(name, text) => set({ tide_table: text, tide_source: name })}
          >
            {draft.value.tide_table
              ? say("mission.table", { tideSource: draft.value.tide_source })
              : say("mission.tableTid")}
          </FileButton>
          <p class="hint">{say("mission.tidesCanBeSetAndChanged")}</p>
        </details>
        <div class="refusal" role="alert">
          {refused.value ? (
            <p class="reason alarm">
              {refused.value.faults.length > 0
                ? say("mission.whatIsMarkedCannotBeTaken")
                : said(refused.value)}
            </p>
          ) : null}
          {unplaced.value.map((field) => (
            <span key={field} class="fault" data-testid={`unplaced-${field}`}>
              ▲ {field.startsWith("other.") ? `${field.slice("other.".length)}: ` : ""}
              {faults.value[field]}
            </span>
          ))}
        </div>
        <button
          type="submit"
          class="command primary wide"
          disabled={sending.value !== null}
          data-testid="create-mission"
        >
          {sending.value
            ? say("mission.oneMoment")
            : edited
              ? say("mission.saveMission")
              : say("mission.createMission")}
        </button>
        <Keeping draft={draft.value} />
      </form>
    </Form.Provider>
  );
}

/** Faults of what the form does not show. */
function unplacedIn(form: HTMLFormElement, faults: Faults): FaultKey[] {
  const placed = new Set(
    [...form.querySelectorAll<HTMLElement>("[data-testid^='fault-']")].map(({ dataset }) => dataset.testid),
  );
  return (Object.keys(faults) as FaultKey[]).filter((field) => !placed.has(`fault-${field}`));
}

/** Leaves the form; what was typed is lost only after a second click. */
function Cancel(of: { isChanged: () => boolean; isSaving: boolean; onCancel: () => void }) {
  const asked = useSignal(false);
  const busy = of.isSaving;
  const cancel = () => {
    if (of.isChanged()) asked.value = true;
    else of.onCancel();
  };
  return (
    <AskedTwice
      asked={asked}
      first={{ id: "cancel-mission", busy, onClick: cancel, children: say("mission.cancel") }}
      last={{ id: "discard-mission", busy, onClick: of.onCancel, children: say("mission.discard") }}
      keep={{ id: "keep-describing", children: say("mission.goOn") }}
    />
  );
}

/** Brings the first fault into sight, whatever it is folded into: the form is longer than the window. */
function showFault(form: HTMLFormElement): void {
  const fault = form.querySelector("[data-testid^='fault-']") ?? form.querySelector(".refusal");
  for (let part = fault?.closest("details"); part; part = part.parentElement?.closest("details"))
    part.open = true;
  fault?.scrollIntoView({ block: "center" });
  const field = fault?.closest(".field")?.querySelector<HTMLElement>("input, select");
  field?.focus({ preventScroll: true });
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
      <legend>{say("mission.whatFor")}</legend>
      {choice("survey", say("mission.survey"), say("mission.mapTheSeaFloorOfThe"))}
      {choice("search", say("mission.search"), say("mission.lookForSomethingInAPartly"))}
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
  if (draft.kind !== "search") return [...homes, ...blockMarks(draft)];
  return [
    ...homes,
    ...(goal
      ? [
          {
            words: say("mission.goal"),
            sign: "goal" as const,
            at: goal,
            radius_m: length_m(draft.goal_radius_m),
          },
        ]
      : []),
    ...(entry ? [{ words: say("mission.entry"), sign: "entry" as const, at: entry, radius_m: 0 }] : []),
  ];
}

/** The names of several blocks, each in its middle. */
function blockMarks(draft: Draft): PlaceMark[] {
  const blocks = flownBlocks(draft);
  if (blocks.length === 1) return [];
  return blocks.flatMap((block, i) => {
    const bounds = boundsOf(block.ring);
    if (!bounds) return [];
    const [west, south, east, north] = bounds;
    const at: LngLat = [(west + east) / 2, (south + north) / 2];
    return [{ words: blockTitle(block, i), sign: "block" as const, at, radius_m: 0 }];
  });
}

/** Where vehicles come home to, and what sends them there. */
function RecoveryFields() {
  const { draft } = useForm();
  return (
    <fieldset>
      <legend>{say("mission.recovery")}</legend>
      <PlaceField field="recovery" label={say("mission.recoveryPoint")} />
      {draft.recovery.trim() === "" ? (
        <p class="hint">{say("mission.withoutOneVehiclesStopAnd")}</p>
      ) : (
        <div class="pair">
          <Part of="recovery" />
        </div>
      )}
    </fieldset>
  );
}
