import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { api, type Described } from "../../api/client";
import type { PlanView } from "../../api/types";
import { vehicleColour } from "../../map/picture/palette";
import { comingFrom, inAll, inSequence, type PlannedVehicle, total } from "../../state/form/blocks";
import type { Estimate, Share } from "../../state/form/draft";
import { type NamedPlan, planFileName, planGeoJson, planGpx } from "../../state/form/planFile";
import { LatestAsker, plansOf } from "../../state/form/planning";
import { distance, duration, durations, percent } from "../../state/format";
import { reasonOf } from "../../state/session";
import { fleet, planned } from "../../state/store";
import { say } from "../../words/say";
import { Button } from "../parts/Controls";
import { save } from "../parts/download";
import { WholeSurvey } from "./WholeSurvey";

const PERCENT = 100;
/** By so much a way that is cut off may be longer than it says. */
const ROUNDING_M = 0.5;
const shareOf = (part: number, whole: number) => (part / whole) * PERCENT;

/** Keeps the plan on the map in step with the blocks that are described, null while one is no mission; returns what is wrong. */
export function usePlan(described: string | null): string {
  const fault = useSignal("");
  const asker = useRef<LatestAsker<PlanView[]> | null>(null);
  asker.current ??= new LatestAsker<PlanView[]>(plansOf(api.plan, followingIn), (answer, current) => {
    const before = planned.peek() ?? { plans: [], fresh: 0 };
    if ("found" in answer) {
      const found = inSequence(answer.found);
      // Blocks whose turn has not come keep what was planned for them before.
      planned.value = {
        plans: [...found, ...before.plans.slice(found.length)],
        fresh: current ? found.length : 0,
      };
      fault.value = "";
    } else if (current) {
      const { plans, fresh } = before;
      planned.value = fresh > 0 ? { plans: plans.slice(0, fresh), fresh } : null;
      fault.value = reasonOf(answer.error);
    }
  });
  useEffect(() => {
    asker.current?.want(described);
    fault.value = "";
    const plans = planned.peek()?.plans.slice(0, described === null ? 0 : countOf(described));
    planned.value = plans && plans.length > 0 ? { plans, fresh: 0 } : null;
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

const followingIn = (before: PlanView | undefined, one: Described): Described => ({
  ...one,
  mission: comingFrom(before, one.mission),
});

const countOf = (described: string): number => (JSON.parse(described) as unknown[]).length;

interface PlannedProps {
  of: Estimate;
  /** Of the mission. */
  name: string;
  /** Of the blocks, in their order. */
  names: readonly string[];
  /** Which of them the form's fields describe. */
  turn: number;
  fault: string;
}

/** What each vehicle does by the plan, or at most while there is none, beside the energy that it has. */
export function Planned({ of: { shares }, name, names, turn, fault }: PlannedProps) {
  const { plans: all, fresh } = planned.value ?? { plans: [], fresh: 0 };
  // What is answered late may be of more blocks than there are now.
  const plans = all.slice(0, names.length);
  const state = plans.length === 0 ? "none" : fresh < names.length ? "old" : "new";
  const several = names.length > 1;
  const [only] = plans;
  return (
    <div class={several ? "planned several" : "planned"} data-testid="planned" data-plan={state}>
      {several ? (
        <InBlocks plans={plans} fresh={fresh} names={names} failed={fault !== ""} />
      ) : only ? (
        <Whole plan={only} id="planned-whole" />
      ) : null}
      {several ? (
        <>
          <Team
            caption={say("blocks.inAll")}
            old={state === "old"}
            shares={shares.map((share) => ({ ...share, metres: 0 }))}
            partsOf={(name) => (plans.length < names.length ? [] : plans.flatMap(partsOf(name)))}
            unplanned={fault ? "–" : say("planned.notYet")}
          />
          {plans.map((plan, i) => (
            <details
              key={names[i]}
              class={i < fresh ? "" : "old"}
              open={i === turn}
              data-testid={`of-block-${i + 1}`}
            >
              <summary>{names[i]}</summary>
              <Whole plan={plan} />
              <Team
                shares={shares.map((share) => (i === turn ? share : { ...share, metres: 0 }))}
                partsOf={(name) => partsOf(name)(plan)}
                id={`block-${i + 1}-`}
                later={i > 0}
              />
              <Assumptions plan={plan} />
            </details>
          ))}
        </>
      ) : (
        <Team shares={shares} partsOf={(name) => (only ? partsOf(name)(only) : [])} />
      )}
      {state === "new" ? (
        <SavePlan
          plans={plans.map((plan, i) => ({ block: several ? (names[i] ?? "") : "", plan }))}
          name={name}
        />
      ) : null}
      {fault ? (
        <p class="reason" role="status" data-testid="plan-fault">
          {several && plans.length < names.length
            ? say("planned.noPlanOf", { name: names[plans.length] ?? "", fault })
            : say("planned.noPlan", { fault })}
        </p>
      ) : null}
      {only && !several ? <Assumptions plan={only} /> : null}
    </div>
  );
}

/** Gives the ways that are drawn as files; made here, of what the page has. */
function SavePlan({ plans, name }: { plans: readonly NamedPlan[]; name: string }) {
  const button = (format: string, made: (plans: readonly NamedPlan[]) => string, type: string) => {
    const ending = format.toLowerCase();
    return (
      <Button
        id={`save-plan-${ending}`}
        kind="link-button"
        aria-label={say("planned.savePlanAs", { format })}
        onClick={() => save(planFileName(name, ending), new Blob([made(plans)], { type }))}
      >
        {format}
      </Button>
    );
  };
  return (
    <p class="save-plan">
      {say("planned.savePlan")}: {button("GeoJSON", planGeoJson, "application/geo+json")}{" "}
      {button("GPX", planGpx, "application/gpx+xml")}
    </p>
  );
}

const partsOf = (name: string) => (plan: PlanView) => plan.vehicles.filter(({ vehicle }) => vehicle === name);

interface BlocksProps {
  plans: readonly PlanView[];
  fresh: number;
  names: readonly string[];
  failed: boolean;
}

/** Each block with its time and length, in which the way over into it counts, and the sum. */
function InBlocks({ plans, fresh, names, failed }: BlocksProps) {
  const missing = failed ? "–" : say("planned.notYet");
  const all = plans.length < names.length ? null : plans;
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
        {names.map((name, i) => {
          const plan = plans[i];
          return (
            <tr key={name} class={i < fresh ? "" : "old"} data-testid={`in-block-${i + 1}`}>
              <th scope="row">{name}</th>
              <td>{plan ? between(plan.duration_s_range) : missing}</td>
              <td>{plan ? distance(plan.distance_m) : ""}</td>
            </tr>
          );
        })}
      </tbody>
      <tfoot>
        <tr class={fresh < names.length ? "old" : ""} data-testid="in-blocks-all">
          <th scope="row">{say("blocks.inAll")}</th>
          <td>
            {all
              ? between({
                  low: total(all, (plan) => plan.duration_s_range.low),
                  high: total(all, (plan) => plan.duration_s_range.high),
                })
              : missing}
          </td>
          <td>{all ? distance(total(all, (plan) => plan.distance_m)) : ""}</td>
        </tr>
      </tfoot>
    </table>
  );
}

/** All vehicles of a plan together. */
function Whole({ plan, id }: { plan: PlanView; id?: string }) {
  return (
    <>
      <p>
        <b data-testid={id}>
          {say("planned.planned", {
            length: distance(plan.distance_m),
            time: between(plan.duration_s_range),
          })}
        </b>
      </p>
      {plan.whole_survey ? <WholeSurvey whole={plan.whole_survey} /> : null}
    </>
  );
}

function Assumptions({ plan }: { plan: PlanView }) {
  return (
    <details class="hint">
      <summary>{say("planned.whatIsTakenToBeSo")}</summary>
      <ul class="assumptions">
        {plan.assumptions.map((words) => (
          <li key={words}>{words}</li>
        ))}
      </ul>
    </details>
  );
}

interface TeamProps {
  shares: readonly Share[];
  /** What a vehicle does, one after the other; nothing while that is not planned. */
  partsOf: (name: string) => readonly PlannedVehicle[];
  /** Before the vehicles' own ids. */
  id?: string;
  /** Whether its energy is what other blocks left. */
  later?: boolean;
  caption?: string;
  /** Whether it is of what was described before. */
  old?: boolean;
  /** Instead of the most that it may fly, while there is no plan. */
  unplanned?: string;
}

function Team({ shares, partsOf, id = "", later = false, caption, old, unplanned }: TeamProps) {
  return (
    <table class={old ? "shares old" : "shares"} data-testid={`${id}shares`}>
      {caption ? <caption>{caption}</caption> : null}
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
          id={`${id}share-${share.name}`}
          share={share}
          colour={vehicleColour(i)}
          plan={inAll(partsOf(share.name))}
          later={later}
          unplanned={unplanned}
        />
      ))}
    </table>
  );
}

const titles = () => [say("asked.time"), say("asked.length"), say("planned.wayHome"), say("asked.energy")];

interface RowsProps {
  id: string;
  share: Share;
  colour: string;
  plan: PlannedVehicle | undefined;
  later: boolean;
  unplanned: string | undefined;
}

function Rows({ id, share, colour, plan, later, unplanned }: RowsProps) {
  const { name } = share;
  const { short, words } = energyOf(share, plan, later);
  return (
    <tbody data-testid={id} class={short ? "short" : ""}>
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
      {!plan && unplanned ? (
        <tr>
          <td colSpan={4}>{unplanned}</td>
        </tr>
      ) : (
        <tr>
          <td>{plan ? between(plan.duration_s_range) : duration(share.seconds)}</td>
          <td>
            {plan && plan.distance_m < share.metres + ROUNDING_M
              ? say("planned.ofAtMost", {
                  planned: distance(plan.distance_m),
                  most: distance(share.metres),
                })
              : distance(plan?.distance_m ?? share.metres)}
          </td>
          <td>{homeOf(plan)}</td>
          <td>{words}</td>
        </tr>
      )}
    </tbody>
  );
}

function homeOf(plan: PlannedVehicle | undefined): string {
  if (plan?.distance_home_m == null) return "–";
  return say("planned.in", { way: distance(plan.distance_home_m), time: duration(plan.home_s) });
}

function energyOf(
  { name, seconds, endurance_s }: Share,
  plan: PlannedVehicle | undefined,
  later: boolean,
): { words: string; short: boolean } {
  const needs_s = plan?.energy_needs_s ?? seconds;
  if (later && plan?.energy_left_s != null) {
    const short = needs_s > plan.energy_left_s;
    if (plan.energy_left_s <= 0) return { short, words: say("planned.nothingIsLeftThen") };
    const share = percent(shareOf(needs_s, plan.energy_left_s));
    return { short, words: say("planned.ofWhatIsLeftThen", { it: short ? "▲ " : "", share }) };
  }
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

const between = ({ low, high }: { low: number; high: number }): string => durations(low, high);
