import "./LinksDialog.css";
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import type { DoctorView, Finding, VehicleDiagnosis } from "../../api/types";
import { clock } from "../../state/format";
import { said } from "../../state/session";
import { FINDING_SIGNS, FINDING_TONES } from "../../state/stateNames";
import { linksOpen } from "../../state/store";
import { say } from "../../words/say";
import { sets } from "../parts/Controls";
import { Dialog } from "../parts/Dialog";

const AGAIN_MS = 5000;

/** What keeps vehicles from working with us, as the link doctor sees it now. */
export function LinksDialog() {
  const found = useSignal<DoctorView | null>(null);
  const trouble = useSignal("");
  const open = linksOpen.value;

  useEffect(() => {
    if (!open) return;
    const ask = async () => {
      try {
        found.value = await api.doctor();
        trouble.value = "";
      } catch (error) {
        trouble.value = said(error);
      }
    };
    void ask();
    const again = setInterval(() => void ask(), AGAIN_MS);
    return () => clearInterval(again);
  }, [open]);

  const close = sets(linksOpen, false);
  const view = found.value;
  return (
    <Dialog
      open={open}
      onClose={close}
      name="links"
      heading={say("links.linksToImcVehicles")}
      fault={trouble.value}
      kind="links"
    >
      {view ? (
        <div aria-live="polite">
          <Findings findings={view.own} />
          {view.vehicles.map((vehicle) => (
            <Vehicle key={vehicle.imc_id} vehicle={vehicle} />
          ))}
        </div>
      ) : null}
    </Dialog>
  );
}

function Vehicle({ vehicle }: { vehicle: VehicleDiagnosis }) {
  return (
    <section data-testid={`links-${vehicle.name}`} data-healthy={vehicle.healthy}>
      <h3>
        {vehicle.name} <span class="small">0x{vehicle.imc_id.toString(16).padStart(4, "0")}</span>
      </h3>
      <Findings findings={vehicle.findings} />
      <details>
        <summary>{say("links.howItsLinkChanged")}</summary>
        <ol class="small">
          {vehicle.history.map((record) => (
            <li key={`${record.at}${record.state}${record.reason}`}>
              {clock(new Date(record.at), "utc")} {record.state.replaceAll("_", " ")}
              {record.reason ? `: ${record.reason}` : ""}
            </li>
          ))}
        </ol>
      </details>
    </section>
  );
}

function Findings({ findings }: { findings: readonly Finding[] }) {
  return (
    <ul class="findings">
      {findings.map((finding) => (
        <li key={finding.text} data-cause={finding.cause}>
          <span class={`tone ${FINDING_TONES[finding.severity]}`}>
            <span aria-hidden="true">{FINDING_SIGNS[finding.severity]}</span>{" "}
            <span class="visually-hidden">{finding.severity}: </span>
          </span>
          {finding.text}
          {finding.remedy ? (
            <p class={`reason ${FINDING_TONES[finding.severity]}`}>{finding.remedy}</p>
          ) : null}
        </li>
      ))}
    </ul>
  );
}
