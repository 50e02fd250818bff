import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { api, ServiceError } from "../../api/client";
import type { PlanView } from "../../api/types";
import { vehicleColour } from "../../map/picture/palette";
import { comingFrom } from "../../state/form/blocks";
import type { Estimate, Share } from "../../state/form/draft";
import { LatestAsker, plansOf } from "../../state/form/planning";
import { distance, duration, percent } from "../../state/format";
import { said } from "../../state/session";
import { fleet, planned } from "../../state/store";
import { say } from "../../words/say";
import { WholeSurvey } from "./WholeSurvey";

const PERCENT = 100;
/** By so much a way that is cut off may be longer than it says. */
const ROUNDING_M = 0.5;
const shareOf = (part: number, whole: number) => (part / whole) * PERCENT;

/** Keeps the plan on the map in step with the blocks that are described, null while one is no mission; returns what is wrong. */
export function usePlan(described: string | null): string {
  const fault = useSignal("");
  const asker = useRef<LatestAsker<PlanView[]> | null>(null);
  asker.current ??= new LatestAsker<PlanView[]>(plansOf(api.plan, comingFrom), (answer, current) => {
    if ("found" in answer) {
      planned.value = { plans: answer.found, old: !current };
      fault.value = "";
    } else if (current) {
      planned.value = null;
      fault.value = reasonOf(answer.error);
    }
  });
  useEffect(() => {
    asker.current?.want(described);
    fault.value = "";
    const { plans } = planned.peek() ?? {};
    planned.value = plans && described !== null ? { plans, old: true } : null;
  }, [described]);
  useEffect(
    () => () => {
      asker.current?.want(null);
      planned.value = null;
    },
    [],
  );
  return fault.value;
}

/** What the service says is wrong with single fields, or with all. */
function reasonOf(error: unknown): string {
  const faults = error instanceof ServiceError ? error.faults : [];
  return faults.length > 0 ? faults.map(({ message }) => message).join("; ") : said(error);
}

type Vehicle = PlanView["vehicles"][number];

interface PlannedProps {
  of: Estimate;
  /** Of the blocks, in their order. */
  names: readonly string[];
  /** Which of them is told of in detail. */
  turn: number;
  fault: string;
}

/** Each block with its time and length, in which the way over into it counts, and the sum. */
function InBlocks({ plans, names }: { plans: readonly PlanView[]; names: readonly string[] }) {
  const sum = (of: (plan: PlanView) => number) => plans.reduce((all, plan) => all + of(plan), 0);
  const whole = {
    low: sum((plan) => plan.duration_s_range.low),
    high: sum((plan) => plan.duration_s_range.high),
  };
  return (
    <table class="shares in-blocks" data-testid="in-blocks">
      <thead>
        <tr>
          <th scope="col">{say("blocks.blocks")}</th>
          <th scope="col">{say("asked.time")}</th>
          <th scope="col">{say("asked.length")}</th>
        </tr>
      </thead>
      <tbody>
        {plans.map((plan, i) => (
          <tr key={names[i]} data-testid={`in-block-${i + 1}`}>
            <th scope="row">{names[i]}</th>
            <td>{between(plan.duration_s_range)}</td>
            <td>{distance(plan.distance_m)}</td>
          </tr>
        ))}
      </tbody>
      <tfoot>
        <tr data-testid="in-blocks-all">
          <th scope="row">{say("blocks.inAll")}</th>
          <td>{between(whole)}</td>
          <td>{distance(sum((plan) => plan.distance_m))}</td>
        </tr>
      </tfoot>
    </table>
  );
}

/** What each vehicle does by the plan, or at most while there is none, beside the energy that it has. */
export function Planned({ of: { shares }, names, turn, fault }: PlannedProps) {
  const { plans, old } = planned.value ?? { plans: [], old: false };
  const plan = plans[turn] ?? null;
  const state = plan === null ? "none" : old ? "old" : "new";
  return (
    <div class="planned" data-testid="planned" data-plan={state}>
      {names.length > 1 && plans.length === names.length ? <InBlocks plans={plans} names={names} /> : null}
      {plan ? (
        <p>
          <b data-testid="planned-whole">
            {names.length > 1 ? `${names[turn]} · ` : ""}
            {say("planned.planned", {
              length: distance(plan.distance_m),
              time: between(plan.duration_s_range),
            })}
          </b>
        </p>
      ) : null}
      {plan?.whole_survey ? <WholeSurvey whole={plan.whole_survey} /> : null}
      <table class="shares" data-testid="shares">
        <thead>
          <tr>
            {titles().map((title) => (
              <th key={title} scope="col">
                {title}
              </th>
            ))}
          </tr>
        </thead>
        {shares.map((share, i) => (
          <Rows
            key={share.name}
            share={share}
            colour={vehicleColour(i)}
            plan={plan?.vehicles.find((one) => one.vehicle === share.name)}
          />
        ))}
      </table>
      {fault ? (
        <p class="reason" role="status" data-testid="plan-fault">
          {say("planned.noPlan", { fault })}
        </p>
      ) : null}
      {plan ? (
        <details class="hint">
          <summary>{say("planned.whatIsTakenToBeSo")}</summary>
          <ul class="assumptions">
            {plan.assumptions.map((words) => (
              <li key={words}>{words}</li>
            ))}
          </ul>
        </details>
      ) : null}
    </div>
  );
}

const titles = () => [say("asked.time"), say("asked.length"), say("planned.wayHome"), say("asked.energy")];

function Rows({ share, colour, plan }: { share: Share; colour: string; plan: Vehicle | undefined }) {
  const { name } = share;
  const { short, words } = energyOf(share, plan);
  return (
    <tbody data-testid={`share-${name}`} class={short ? "short" : ""}>
      <tr>
        <th scope="rowgroup" colSpan={4}>
          {plan ? <span class="swatch" style={{ background: colour }} aria-hidden="true" /> : null}
          {name}
          {plan?.turn_back_m != null ? (
            <span class="turn-back">
              {" "}
              {say("planned.turnsBackAfter", { way: distance(plan.turn_back_m) })}
            </span>
          ) : null}
        </th>
      </tr>
      <tr>
        <td>{plan ? between(plan.duration_s_range) : duration(share.seconds)}</td>
        <td>
          {plan && plan.distance_m < share.metres + ROUNDING_M
            ? say("planned.ofAtMost", { planned: distance(plan.distance_m), most: distance(share.metres) })
            : distance(plan?.distance_m ?? share.metres)}
        </td>
        <td>{homeOf(plan)}</td>
        <td>{words}</td>
      </tr>
    </tbody>
  );
}

function homeOf(plan: Vehicle | undefined): string {
  if (plan?.distance_home_m == null) return "–";
  return say("planned.in", { way: distance(plan.distance_home_m), time: duration(plan.home_s) });
}

function energyOf(
  { name, seconds, endurance_s }: Share,
  plan: Vehicle | undefined,
): { words: string; short: boolean } {
  const needs_s = plan?.energy_needs_s ?? seconds;
  const battery_pct = fleet.value.find((v) => v.name === name)?.battery_pct ?? null;
  if (plan?.energy_left_s != null && (battery_pct !== null || endurance_s === null)) {
    const short = needs_s > plan.energy_left_s;
    const share = percent(shareOf(needs_s, plan.energy_left_s));
    return { short, words: say("planned.ofItsBattery", { it: short ? "▲ " : "", share }) };
  }
  if (endurance_s !== null) {
    const short = needs_s > (plan?.energy_left_s ?? endurance_s);
    const share = percent(shareOf(needs_s, endurance_s));
    return { short, words: say("asked.ofItsEndurance", { it: short ? "▲ " : "", seconds: share }) };
  }
  if (battery_pct !== null)
    return { short: false, words: say("asked.battery", { batteryPct: percent(battery_pct) }) };
  return { short: false, words: say("asked.notKnown") };
}

/** "low to high" where they differ as they are shown. */
function between({ low, high }: { low: number; high: number }): string {
  const [a, b] = [duration(low), duration(high)];
  return a === b ? a : say("forecast.to", { low: a, high: b });
}
