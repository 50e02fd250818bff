import { schemaOf } from "../../state/form/missionFields";
import { optionField } from "../../state/form/plannerOptions";
import { pointed } from "../../state/format";
import { say } from "../../words/say";
import { Fault, useForm } from "./Fields";

/** The planner's settings; an empty field takes what is usual. */
export function PlannerOptionFields({ names }: { names: readonly string[] }) {
  const { draft, faults, set } = useForm();
  const change = (name: string, text: string) =>
    set(({ options }) => ({ options: { ...options, [name]: text } }));
  return (
    <div class="options">
      {names.map((name) => {
        const field = optionField(name);
        if (!field) return null;
        const { type, default: usual, description, enum: choices } = schemaOf(field);
        const id = `option-${name}`;
        const text = draft.options[name] ?? "";
        if (type === "boolean")
          return (
            <label key={name} class="check" title={description}>
              <input
                id={id}
                type="checkbox"
                checked={(text || String(usual)) === "true"}
                onChange={(event) => change(name, String(event.currentTarget.checked))}
              />
              {field.label}
            </label>
          );
        return (
          <div key={name} class="field">
            <label for={id}>{field.label}</label>
            {choices ? (
              <select
                id={id}
                value={text || String(usual)}
                onChange={(event) => change(name, event.currentTarget.value)}
              >
                {choices.map((value) => (
                  <option key={value}>{value}</option>
                ))}
              </select>
            ) : (
              <input
                id={id}
                type="text"
                inputMode="decimal"
                autocomplete="off"
                value={text}
                placeholder={usual == null ? say("expert.automatic") : String(usual)}
                aria-invalid={faults[`options.${name}`] ? "true" : "false"}
                onInput={(event) => change(name, pointed(event.currentTarget.value))}
              />
            )}
            <Fault field={`options.${name}`} />
            <small>{description}</small>
          </div>
        );
      })}
    </div>
  );
}
