import { type Signal, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { api } from "../../api/client";
import type { MountingEstimateView, MountingParameter, MountingSpec } from "../../api/types";
import { count, fixed } from "../../state/format";
import { said } from "../../state/session";
import { selectedId } from "../../state/store";
import { type Key, say } from "../../words/say";
import { Button } from "../parts/Controls";
import { described } from "./mountingWords";

const UNKNOWN = {
  roll_deg: "mountings.rollUnknown",
  pitch_deg: "mountings.pitchUnknown",
  heading_deg: "mountings.headingUnknown",
  latency_s: "mountings.latencyUnknown",
} as const satisfies Record<MountingParameter, Key>;

/** What lines may tell of a mounting, by the fields' names. */
export const PARAMETERS = Object.keys(UNKNOWN) as MountingParameter[];

const digits = (name: MountingParameter) => (name === "latency_s" ? 3 : 2);

/** What was estimated for a field; nothing where nothing was. */
export function Estimated({ of, found }: { of: string; found: MountingEstimateView | null }) {
  const one = found?.parameters.find(({ name }) => name === of);
  if (one?.value == null || one.sd == null) return null;
  const [value, sd] = [fixed(one.value, digits(one.name)), fixed(one.sd, digits(one.name))];
  return (
    <small class="hint" data-testid={`estimated-${of}`}>
      {say("mountings.estimated", { value, sd })}
    </small>
  );
}

interface Props {
  vehicle: string;
  estimate: Signal<MountingEstimateView | null>;
  fault: Signal<string>;
  /** Fills the fields. */
  take: (mounting: MountingSpec) => void;
}

/** How a sonar is mounted by what lines say that overlap: asked for, shown, and taken over into the fields. */
export function MountingEstimate({ vehicle, estimate, fault, take }: Props) {
  const busy = useSignal(false);
  const asking = useRef<AbortController | null>(null);
  useEffect(() => () => asking.current?.abort(), []);
  const ask = async () => {
    const id = selectedId.peek();
    if (!id) return;
    const gone = new AbortController();
    asking.current = gone;
    busy.value = true;
    fault.value = "";
    estimate.value = null;
    try {
      estimate.value = await api.estimateMounting(id, vehicle, gone.signal);
    } catch (error) {
      if (!gone.signal.aborted) fault.value = said(error);
    } finally {
      busy.value = false;
    }
  };
  const found = estimate.value;
  const proposal = found?.proposal;
  return (
    <>
      <p class="row">
        <Button id="mounting-estimate" commands busy={busy.value} onClick={() => void ask()}>
          {say(busy.value ? "mountings.estimating" : "mountings.estimate")}
        </Button>
        {proposal ? (
          <Button id="mounting-take" commands onClick={() => take(proposal)}>
            {say("mountings.takeOver")}
          </Button>
        ) : null}
      </p>
      {found ? (
        <div class="hint" data-testid="mounting-estimated" role="status">
          <p>
            {say("mountings.compared", {
              lines: count(found.lines.length),
              cells: count(found.cells),
              before: fixed(found.before_m, 3),
              after: fixed(found.after_m, 3),
            })}{" "}
            {proposal
              ? say("mountings.proposed", { mounting: described(proposal) })
              : say("mountings.nothingProposed")}
          </p>
          {found.parameters
            .filter(({ value }) => value == null)
            .map(({ name }) => (
              <p key={name} data-testid={`unknown-${name}`}>
                {say(UNKNOWN[name])}
              </p>
            ))}
        </div>
      ) : null}
    </>
  );
}
