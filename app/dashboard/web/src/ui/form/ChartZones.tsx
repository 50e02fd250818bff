import { useSignal } from "@preact/signals";
import { api, type Sending } from "../../api/client";
import type { LngLat, ProposedZonesView } from "../../api/types";
import { ringOf } from "../../map/area";
import { boundsOf } from "../../map/geo";
import { whyNotCommand } from "../../state/access";
import { cornersOf } from "../../state/form/draft";
import { withRings } from "../../state/form/places";
import { metres } from "../../state/format";
import { said } from "../../state/session";
import { say } from "../../words/say";
import { Button, FilesButton, Trouble } from "../parts/Controls";
import { useForm } from "./Fields";

type Zone = ProposedZonesView["zones"][number];

/** Degrees around the area in which a chart is looked at: what lies beside it matters where vehicles turn. */
const AROUND_DEG = 0.002;

const ring = ({ zone }: Zone): readonly LngLat[] => ringOf(zone as Parameters<typeof ringOf>[0]);

/** What an ENC cell shows to keep out of, for choosing: what is ticked is a keep-out zone, and drawn on the map. */
export function ChartZones() {
  const { draft, set } = useForm();
  const found = useSignal<ProposedZonesView | null>(null);
  const busy = useSignal(false);
  const fault = useSignal("");
  const reading = useSignal<AbortController | null>(null);
  const bounds = boundsOf(cornersOf(draft));
  const propose = async ([file]: File[]) => {
    if (!file || !bounds) return;
    const [west, south, east, north] = bounds;
    const stop = new AbortController();
    busy.value = true;
    fault.value = "";
    found.value = null;
    reading.value = stop;
    const sending: Sending = { file, onBytes: () => {}, gone: stop.signal };
    const ends = {
      west_deg: String(west - AROUND_DEG),
      south_deg: String(south - AROUND_DEG),
      east_deg: String(east + AROUND_DEG),
      north_deg: String(north + AROUND_DEG),
    };
    try {
      found.value = await api.proposeZones(ends, sending);
    } catch (error) {
      if (!stop.signal.aborted) fault.value = said(error);
    } finally {
      busy.value = false;
      reading.value = null;
    }
  };
  const taken = new Set(draft.keepOut.map((zone) => zone.join()));
  const choose = (zone: Zone, isTaken: boolean) => {
    const chosen = ring(zone);
    set(({ keepOut }) => ({
      keepOut: isTaken ? withRings(keepOut, [chosen]) : keepOut.filter((one) => one.join() !== chosen.join()),
    }));
  };
  if (whyNotCommand.value || !bounds || cornersOf(draft).length < 3) return null;
  return (
    <div class="chart-zones">
      <FilesButton accept=".000" id="chart-file" busy={busy.value} onFiles={(files) => void propose(files)}>
        {say(busy.value ? "area.chartBeingRead" : "area.zonesFromAChart")}
      </FilesButton>
      {reading.value ? (
        <Button kind="link-button" id="chart-cancel" onClick={() => reading.value?.abort()}>
          {say("mission.cancel")}
        </Button>
      ) : null}
      <Trouble words={fault.value} />
      {found.value ? (
        <div data-testid="chart-zones">
          <p class="hint">{say("area.zonesProposed", { count: found.value.zones.length })}</p>
          {found.value.zones.map((zone, i) => (
            <label key={String(i)} class="check">
              <input
                type="checkbox"
                checked={taken.has(ring(zone).join())}
                onChange={(event) => choose(zone, event.currentTarget.checked)}
              />
              {[zone.reason, zone.name].filter(Boolean).join(" ")}
              {zone.depth_m === null ? "" : `, ${metres(zone.depth_m, 1)}`}
              {zone.position_m > 0 ? ` (± ${metres(zone.position_m, 0)})` : ""}
            </label>
          ))}
          {found.value.notes.map((note) => (
            <p key={note} class="hint">
              {note}
            </p>
          ))}
        </div>
      ) : null}
    </div>
  );
}
