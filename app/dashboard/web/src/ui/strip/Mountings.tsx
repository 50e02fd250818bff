import { useSignal } from "@preact/signals";
import { api } from "../../api/client";
import type { MountingEstimateView, MountingSpec, MountingView } from "../../api/types";
import { plain } from "../../state/format";
import { say } from "../../words/say";
import { Button, Typed } from "../parts/Controls";
import { numberOf, type PartProps } from "./correctionParts";
import { Estimated, MountingEstimate, PARAMETERS } from "./MountingEstimate";
import { described } from "./mountingWords";

/** How sonars are mounted, each corrected by what its patch test told. */
export function Mountings({ found, busy, change, fault }: PartProps) {
  return (
    <section class="casts" data-testid="mountings" aria-label={say("mountings.mountings")}>
      <h3>{say("mountings.mountings")}</h3>
      <p class="hint">{say("mountings.signs")}</p>
      {found.mountings.map((one) => (
        <Mounting
          key={`${one.vehicle} ${JSON.stringify(counted(one))}`}
          one={one}
          busy={busy}
          change={change}
          fault={fault}
        />
      ))}
    </section>
  );
}

/** What counts: the correction, or else what the vehicle states. */
const counted = ({ stated, corrected }: MountingView): MountingSpec => corrected ?? stated;

interface OneProps extends Omit<PartProps, "found"> {
  one: MountingView;
}

function Mounting({ one, busy, change, fault }: OneProps) {
  const now = counted(one);
  const numbers = {
    roll_deg: useSignal(plain(now.roll_deg)),
    pitch_deg: useSignal(plain(now.pitch_deg)),
    heading_deg: useSignal(plain(now.heading_deg)),
    latency_s: useSignal(plain(now.latency_s)),
    forward: useSignal(plain(now.offset_m[0])),
    starboard: useSignal(plain(now.offset_m[1])),
    down: useSignal(plain(now.offset_m[2])),
  };
  const source = useSignal(now.source);
  const estimate = useSignal<MountingEstimateView | null>(null);
  const labels: [keyof typeof numbers, string][] = [
    ["roll_deg", say("mountings.rollDeg")],
    ["pitch_deg", say("mountings.pitchDeg")],
    ["heading_deg", say("mountings.headingDeg")],
    ["latency_s", say("mountings.latencyS")],
    ["forward", say("mountings.forwardM")],
    ["starboard", say("mountings.starboardM")],
    ["down", say("mountings.downM")],
  ];
  const apply = () => {
    const [roll_deg, pitch_deg, heading_deg, latency_s, forward, starboard, down] = labels.map(([name]) =>
      numberOf(numbers[name]),
    );
    if (
      roll_deg == null ||
      pitch_deg == null ||
      heading_deg == null ||
      latency_s == null ||
      forward == null ||
      starboard == null ||
      down == null
    ) {
      fault.value = say("corrections.typeNumbers");
      return;
    }
    const offset_m: MountingSpec["offset_m"] = [forward, starboard, down];
    const mounting = { roll_deg, pitch_deg, heading_deg, latency_s, offset_m, source: source.peek().trim() };
    void change((id) => api.setMounting(id, one.vehicle, mounting));
  };
  return (
    <details data-testid={`mounting-${one.vehicle}`}>
      <summary>
        <b>{one.vehicle}</b> {described(now)}
        {now.source ? ` (${now.source})` : ""}
        {one.corrected ? ` · ${say("mountings.stated", { mounting: described(one.stated) })}` : ""}
      </summary>
      <div class="fields">
        {labels.map(([name, label]) => (
          <label class="field" key={name}>
            {label}
            <Typed text={numbers[name]} id={`mounting-${name}`} />
            <Estimated of={name} found={estimate.value} />
          </label>
        ))}
        <label class="field">
          {say("mission.fromWhere")}
          <Typed
            text={source}
            id="mounting-source"
            placeholder={say("mountings.patchTest")}
            maxLength={200}
          />
        </label>
      </div>
      <MountingEstimate
        vehicle={one.vehicle}
        estimate={estimate}
        fault={fault}
        take={(mounting) => {
          for (const name of PARAMETERS) numbers[name].value = plain(mounting[name]);
          source.value = mounting.source;
        }}
      />
      <p class="row">
        <Button id="mounting-set" commands busy={busy.value} onClick={apply}>
          {say("mountings.apply")}
        </Button>
        {one.corrected ? (
          <Button
            id="mounting-remove"
            commands
            busy={busy.value}
            onClick={() => void change((id) => api.deleteMounting(id, one.vehicle))}
          >
            {say("mountings.asStated")}
          </Button>
        ) : null}
      </p>
    </details>
  );
}
