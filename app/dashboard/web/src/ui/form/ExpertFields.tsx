import { expertOptions, withPlanner } from "../../state/form/plannerOptions";
import { say } from "../../words/say";
import { Choice, same } from "../parts/Controls";
import { Part, useForm } from "./Fields";
import { PlannerOptionFields } from "./PlannerOptionFields";

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
      <PlannerOptionFields names={expertOptions(draft, planners)} />
      {fault ? <span class="fault">▲ {fault}</span> : null}
    </>
  );
}
