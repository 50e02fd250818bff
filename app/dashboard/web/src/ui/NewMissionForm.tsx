import { useSignal, useSignalEffect } from "@preact/signals";
import { type ComponentChildren, createContext } from "preact";
import { useContext, useEffect } from "preact/hooks";
import { api, ServiceError } from "../api/client";
import type { PlannerView, VehicleSpec, VehicleView } from "../api/types";
import {
  areaOf,
  centred,
  type Draft,
  emptyDraft,
  type Faults,
  faultsOf,
  fieldOf,
  toMission,
} from "../state/draft";
import { createMission } from "../state/session";
import { describing, draftArea, fleet, mapCentre } from "../state/store";

interface FormState {
  draft: Draft;
  faults: Faults;
  set: (change: Partial<Draft>) => void;
}

const Form = createContext<FormState | null>(null);

export function NewMissionForm() {
  const draft = useSignal(emptyDraft(mapCentre.peek()));
  const faults = useSignal<Faults>({});
  const refused = useSignal<ServiceError | null>(null);
  const sending = useSignal(false);
  const planners = useSignal<readonly PlannerView[]>([]);

  useSignalEffect(() => {
    draftArea.value = areaOf(draft.value);
  });
  useEffect(() => {
    api.planners().then(
      (list) => {
        planners.value = list;
      },
      (error: unknown) => {
        if (error instanceof ServiceError) refused.value = error;
      },
    );
    return () => {
      draftArea.value = null;
    };
  }, []);

  const close = () => {
    describing.value = false;
  };
  const set = (change: Partial<Draft>) => {
    draft.value = { ...draft.value, ...change };
    if (Object.keys(faults.value).length > 0) faults.value = faultsOf(draft.value);
  };
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    faults.value = faultsOf(draft.value);
    refused.value = null;
    if (Object.keys(faults.value).length > 0) return;
    sending.value = true;
    try {
      await createMission(toMission(draft.value));
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
          <h2>New mission</h2>
          <button type="button" class="command" onClick={close}>
            Cancel
          </button>
        </header>
        <Text field="name" label="Name" placeholder="Leixões quay" />
        <fieldset>
          <legend>Area, from its south-west corner</legend>
          <div class="pair">
            <Text field="latitude" label="Latitude °N" numeric />
            <Text field="longitude" label="Longitude °E" numeric />
            <Text field="east_m" label="To the east, m" numeric />
            <Text field="north_m" label="To the north, m" numeric />
          </div>
          <button
            type="button"
            class="link-button"
            onClick={() => set(centred(draft.value, mapCentre.value))}
          >
            Place it in the middle of the map
          </button>
        </fieldset>
        <fieldset>
          <legend>Vehicles</legend>
          <FleetChoice />
          <Text field="simulated" label="Simulated vehicles" numeric />
        </fieldset>
        <Text field="steps" label="Steps" numeric />
        <label class="field">
          Planner
          <select
            value={draft.value.planner}
            data-testid="field-planner"
            onChange={(event) => set({ planner: event.currentTarget.value })}
          >
            {(planners.value.length > 0 ? planners.value.map((p) => p.name) : [draft.value.planner]).map(
              (name) => (
                <option key={name} value={name}>
                  {name}
                </option>
              ),
            )}
          </select>
          <small>{planners.value.find((p) => p.name === draft.value.planner)?.summary}</small>
          <Fault field="planner" />
        </label>
        <details>
          <summary>Limits and grid</summary>
          <div class="pair">
            <Text field="max_step_m" label="Largest step, m" numeric />
            <Text field="cell_m" label="Cell, m" numeric />
            <Text field="min_depth_m" label="Shallowest, m" numeric />
            <Text field="max_depth_m" label="Deepest, m" numeric />
          </div>
        </details>
        {refused.value ? (
          <p class="reason alarm" role="alert">
            {refused.value.message}. {refused.value.remedy}
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

function useForm(): FormState {
  const form = useContext(Form);
  if (!form) throw new Error("a field outside its form");
  return form;
}

type TextField = Exclude<keyof Draft, "chosen">;

function Text(props: {
  field: TextField;
  label: ComponentChildren;
  placeholder?: string;
  numeric?: boolean;
}) {
  const { draft, faults, set } = useForm();
  const { field, label, numeric = false } = props;
  return (
    <label class="field">
      {label}
      <input
        type="text"
        autocomplete="off"
        value={draft[field]}
        inputMode={numeric ? "decimal" : "text"}
        placeholder={props.placeholder ?? ""}
        aria-invalid={faults[field] ? "true" : "false"}
        data-testid={`field-${field}`}
        onInput={(event) => set({ [field]: event.currentTarget.value })}
      />
      <Fault field={field} />
    </label>
  );
}

function Fault({ field }: { field: keyof Draft }) {
  const { faults } = useForm();
  return faults[field] ? <span class="fault">▲ {faults[field]}</span> : null;
}

/** Real vehicles that the service hears and that are free. */
function FleetChoice() {
  const { draft, set } = useForm();
  const free = fleet.value.filter((v) => v.mission_id === null && v.kind !== "sim");
  if (free.length === 0) {
    return <p class="empty">No real vehicle is heard. Switch one on, or simulate some:</p>;
  }
  const chosen = new Set(draft.chosen.map((v) => v.name));
  const toggle = (vehicle: VehicleView, on: boolean) =>
    set({
      chosen: on ? [...draft.chosen, asSpec(vehicle)] : draft.chosen.filter((v) => v.name !== vehicle.name),
    });
  return (
    <>
      {free.map((v) => (
        <label key={v.name} class="check">
          <input
            type="checkbox"
            checked={chosen.has(v.name)}
            onChange={(event) => toggle(v, event.currentTarget.checked)}
          />
          {v.name} <small>{v.kind === "imc" ? "IMC" : v.kind}</small>
        </label>
      ))}
    </>
  );
}

function asSpec(vehicle: VehicleView): VehicleSpec {
  return { name: vehicle.name, kind: vehicle.kind, sensor: vehicle.sensor ?? "single_beam" };
}
