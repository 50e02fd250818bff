import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import type { PlannerView } from "../../api/types";
import { pointed } from "../../state/format";
import { said } from "../../state/session";
import { say } from "../../words/say";
import { Choice, same } from "../parts/Controls";
import { Part, useForm } from "./Fields";

/** What rarely needs a change: each with its unit, what is usual, and what it is for. */
export function ExpertFields() {
  const { draft } = useForm();
  return (
    <details data-testid="expert">
      <summary>{say("expert.expertSettings")}</summary>
      <div class="expert">
        <h3>{say("expert.limitsAndGrid")}</h3>
        <Part of="limits" explained />
        {draft.kind === "survey" ? (
          <>
            <Algorithm />
            <h3>{say("expert.uncertaintyOfSwathSonars")}</h3>
            <Part of="uncertainty" explained />
          </>
        ) : null}
      </div>
    </details>
  );
}

/** Which planner, also those that are only to compare with, and its settings. */
function Algorithm() {
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
  const usable = planners.value.filter((p) => !p.problem);
  const broken = planners.value.filter((p) => p.problem);
  const chosen = usable.find((p) => p.name === draft.planner);
  /** The settings that another planner has, too: others it would refuse. */
  const kept = (next: PlannerView | undefined) => {
    const known = (next?.options as { properties?: object } | undefined)?.properties ?? {};
    return Object.fromEntries(Object.entries(draft.options).filter(([name]) => name in known));
  };
  return (
    <>
      <h3>{say("compare.planner")}</h3>
      <label class="field">
        {say("compare.planner")}
        <Choice
          value={draft.planner}
          options={same(usable.length > 0 ? usable.map((p) => p.name) : [draft.planner])}
          id="field-planner"
          onChoose={(planner) => set({ planner, options: kept(usable.find((p) => p.name === planner)) })}
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
      <Options schema={chosen?.options} />
      {fault.value ? <span class="fault">▲ {fault.value}</span> : null}
    </>
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
              placeholder={option.default === null ? say("expert.automatic") : String(option.default)}
              onInput={(event) => {
                const text = pointed(event.currentTarget.value.trim());
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
