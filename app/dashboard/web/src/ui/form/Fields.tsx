/** The new mission's form as its parts share it. */

import { type ComponentChildren, createContext } from "preact";
import { useContext } from "preact/hooks";
import type { PlannerView } from "../../api/types";
import { typedPlace } from "../../state/coordinates";
import type { Draft, FaultKey, Faults } from "../../state/form/draft";
import { type Field, type FieldName, fieldsOf, schemaOf, startOf } from "../../state/form/missionFields";
import { pointed } from "../../state/format";
import { picking } from "../../state/store";
import { named, say } from "../../words/say";
import { OwnShip } from "../OwnShip";
import { Button, Choice } from "../parts/Controls";

export interface FormState {
  draft: Draft;
  faults: Faults;
  /** The planners that there are; empty until the service has told. */
  planners: readonly PlannerView[];
  /** A change that follows from what there is then is a function of it. */
  set: (change: Partial<Draft> | ((draft: Draft) => Partial<Draft>)) => void;
}

export const Form = createContext<FormState | null>(null);

export function useForm(): FormState {
  const form = useContext(Form);
  if (!form) throw new Error("a field outside its form");
  return form;
}

/** Fields whose value is any text. */
type TextField = { [K in keyof Draft]: string extends Draft[K] ? K : never }[keyof Draft];

interface TextProps {
  field: TextField;
  label: ComponentChildren;
  placeholder?: string;
  numeric?: boolean;
  hint?: string;
}

export function Text({ field, label, placeholder = "", numeric = false, hint = "" }: TextProps) {
  const { draft, faults, set } = useForm();
  return (
    <label class="field">
      {label}
      <input
        type="text"
        autocomplete="off"
        value={draft[field]}
        inputMode={numeric ? "decimal" : "text"}
        placeholder={placeholder}
        title={hint}
        aria-invalid={faults[field] ? "true" : "false"}
        data-testid={`field-${field}`}
        onInput={({ currentTarget: { value } }) => set({ [field]: numeric ? pointed(value) : value })}
      />
      <Fault field={field} />
    </label>
  );
}

interface PlaceProps {
  id: string;
  label: ComponentChildren;
  text: string;
  onText: (text: string) => void;
  placeholder?: string;
  invalid?: boolean;
  children?: ComponentChildren;
}

/** A place that is typed, or picked on the map. */
export function Place({ id, label, text, onText, placeholder, invalid = false, children }: PlaceProps) {
  const waiting = picking.value?.what === id;
  return (
    <div class="picked">
      <label class="field">
        {label}
        <input
          type="text"
          autocomplete="off"
          value={text}
          placeholder={placeholder ?? say("fields.latitudeLongitude")}
          aria-invalid={invalid ? "true" : "false"}
          data-testid={`field-${id}`}
          onInput={(event) => onText(event.currentTarget.value)}
        />
        {children}
      </label>
      <Button
        id={`pick-${id}`}
        aria-pressed={waiting}
        onClick={() => {
          picking.value = waiting ? null : { what: id, onPicked: (at) => onText(typedPlace(at)) };
        }}
      >
        {waiting ? say("fields.clickOnTheMap") : say("fields.pick")}
      </Button>
      <OwnShip id={id} onPlace={(at) => onText(typedPlace(at))} />
    </div>
  );
}

/** A place of the mission. */
export function PlaceField({ field, label }: { field: "goal" | "entry" | "recovery"; label: string }) {
  const { draft, faults, set } = useForm();
  return (
    <Place
      id={field}
      label={label}
      text={draft[field]}
      onText={(text) => set({ [field]: text })}
      invalid={faults[field] !== undefined}
    >
      <Fault field={field} />
    </Place>
  );
}

/** The plain values of one part of the form, as the service and the table of fields declare them. */
export function Part({ of, explained = false }: { of: Field["part"]; explained?: boolean }) {
  const { draft } = useForm();
  return fieldsOf(draft.kind, draft.length, of).map(([name, field]) =>
    explained ? (
      <div key={name} class="explained">
        <Plain name={name} field={field} />
        <Reason field={field} />
      </div>
    ) : (
      <Plain key={name} name={name} field={field} />
    ),
  );
}

/** What a value is for, and what is usual. */
function Reason({ field }: { field: Field }) {
  const { draft } = useForm();
  const usual = startOf(field, draft.kind) || (field.placeholder ?? "");
  const { description = "" } = schemaOf(field);
  return (
    <small>
      {description}
      {usual
        ? say("fields.usual", {
            it: description ? ". " : "",
            usual,
            it2: field.unit && startOf(field, draft.kind) ? ` ${field.unit}` : "",
          })
        : ""}
    </small>
  );
}

function Plain({ name, field }: { name: FieldName; field: Field }) {
  const { draft, set } = useForm();
  const { type, enum: choices, description = "" } = schemaOf(field);
  const label = field.unit ? `${field.label}, ${field.unit}` : field.label;
  const change = (text: string) => set({ [name]: text });
  if (type === "boolean") {
    return (
      <label class="check" title={description}>
        <input
          type="checkbox"
          checked={draft[name] === "true"}
          data-testid={`field-${name}`}
          onChange={(event) => change(String(event.currentTarget.checked))}
        />
        {label}
      </label>
    );
  }
  if (choices) {
    return (
      <label class="field" title={description}>
        {label}
        <Choice
          value={draft[name]}
          options={choices.map((one) => [one, named("choice", one, one)] as const)}
          id={`field-${name}`}
          onChoose={change}
        />
      </label>
    );
  }
  return (
    <Text
      field={name}
      label={label}
      placeholder={field.placeholder ?? ""}
      numeric={type !== "string"}
      hint={description}
    />
  );
}

export function Fault({ field }: { field: FaultKey }) {
  const { faults } = useForm();
  return faults[field] ? (
    <span class="fault" data-testid={`fault-${field}`}>
      ▲ {faults[field]}
    </span>
  ) : null;
}
