/** The new mission's form as its parts share it. */

import { type ComponentChildren, createContext } from "preact";
import { useContext } from "preact/hooks";
import type { Draft, Faults } from "../state/draft";

export interface FormState {
  draft: Draft;
  faults: Faults;
  set: (change: Partial<Draft>) => void;
}

export const Form = createContext<FormState | null>(null);

export function useForm(): FormState {
  const form = useContext(Form);
  if (!form) throw new Error("a field outside its form");
  return form;
}

type TextField = Exclude<
  keyof Draft,
  "chosen" | "ring" | "keepOut" | "obstacles" | "options" | "source" | "kind" | "base"
>;

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
        onInput={(event) => set({ [field]: event.currentTarget.value })}
      />
      <Fault field={field} />
    </label>
  );
}

export function Fault({ field }: { field: keyof Draft }) {
  const { faults } = useForm();
  return faults[field] ? (
    <span class="fault" data-testid={`fault-${field}`}>
      ▲ {faults[field]}
    </span>
  ) : null;
}
