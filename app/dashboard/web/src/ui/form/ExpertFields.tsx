import { schemaOf } from "../../state/form/missionFields";
import { optionField, optionsOf, withPlanner } from "../../state/form/plannerOptions";
import { pointed } from "../../state/format";
import { say } from "../../words/say";
import { Choice, same } from "../parts/Controls";
import { Fault, Part, useForm } from "./Fields";

/** What rarely needs a change: each with its unit, what is usual, and what it is for. */
export function ExpertFields({ fault }: { fault: string }) {
  const { draft } = useForm();
  return (
    <details data-testid="expert">
      <summary>{say("expert.expertSettings")}</summary>
      <div class="expert">
        <h3>{say("expert.limitsAndGrid")}</h3>
        <Part of="limits" explained />
        {draft.kind === "survey" ? (
          <>
            <Part of="shoals" explained />
            <Algorithm fault={fault} />
            <h3>{say("expert.uncertaintyOfSwathSonars")}</h3>
            <Part of="uncertainty" explained />
          </>
        ) : null}
      </div>
    </details>
  );
}

/** Which planner, also those that are only to compare with, and its settings; `fault`: why none could be listed. */
function Algorithm({ fault }: { fault: string }) {
  const { draft, planners, set } = useForm();
  const usable = planners.filter((p) => !p.problem);
  const broken = planners.filter((p) => p.problem);
  const chosen = usable.find((p) => p.name === draft.planner);
  return (
    <>
      <h3>{say("compare.planner")}</h3>
      <label class="field">
        {say("compare.planner")}
        <Choice
          value={draft.planner}
          options={same(usable.length > 0 ? usable.map((p) => p.name) : [draft.planner])}
          id="field-planner"
          onChoose={(planner) => set((present) => withPlanner(planner, present, planners))}
        />
        {chosen ? (
          <small>
            {chosen.summary} ({chosen.package})
          </small>
        ) : null}
      </label>
      {broken.map((p) => (
        <small key={p.name} class="fault" data-testid={`broken-planner-${p.name}`}>
          {say("expert.ofCannotBeUsed", { p: p.name, package: p.package, problem: p.problem })}
        </small>
      ))}
      <Options names={optionsOf(draft.planner, planners)} />
      {fault ? <span class="fault">▲ {fault}</span> : null}
    </>
  );
}

/** The planner's settings; an empty field takes what is usual. */
function Options({ names }: { names: readonly string[] }) {
  const { draft, faults, set } = useForm();
  const change = (name: string, text: string) =>
    set(({ options }) => ({ options: { ...options, [name]: text } }));
  return (
    <div class="options">
      {names.map((name) => {
        const field = optionField(name);
        if (!field) return null;
        const { default: usual, description, enum: choices } = schemaOf(field);
        const id = `option-${name}`;
        const text = draft.options[name] ?? "";
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
