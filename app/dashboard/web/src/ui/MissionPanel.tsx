import "./MissionPanel.css";
import { useSignal } from "@preact/signals";
import type { MissionSummary, NewMission } from "../api/types";
import { whyNotCommand } from "../state/access";
import { fileNameOf, missionFile } from "../state/missionFile";
import { deleteMission, selectMission } from "../state/session";
import {
  copied,
  describing,
  editedMission,
  fleetOpen,
  mission,
  missions,
  selectedId,
  serviceFault,
} from "../state/store";
import { capital, lengthWords, measuredWords, missionSign, missionWords } from "../state/words";
import { Button, sets } from "./Controls";
import { Grip } from "./Grip";
import { NewMissionForm } from "./NewMissionForm";
import { panelWidth } from "./room";
import { saveText } from "./saving";

export function MissionPanel() {
  return (
    <aside class="panel missions" id="missions" aria-label="Missions">
      <div class="panel-scroll">{describing.value ? <NewMissionForm /> : <MissionList />}</div>
      <Grip what="the missions" size={panelWidth} side="right" least={240} most={640} id="grip-missions" />
    </aside>
  );
}

function MissionList() {
  const list = missions.value;
  return (
    <>
      <header class="panel-head">
        <h2>Missions</h2>
        <Button id="open-fleet" onClick={sets(fleetOpen, true)}>
          Fleet
        </Button>
        <Button id="new-mission" commands onClick={sets(describing, true)}>
          + New
        </Button>
      </header>
      {list === null && !serviceFault.value ? <p class="empty">Asking the service…</p> : null}
      {list?.length === 0 ? (
        <p class="empty">
          No mission yet. <b>+ New</b> describes one: an area, vehicles, and how long it is. Without a vehicle
          at hand choose simulated ones.
        </p>
      ) : null}
      <ul class="mission-list">
        {(list ?? []).map((m) => (
          <li key={m.id}>
            <a
              href={`#/missions/${encodeURIComponent(m.id)}`}
              aria-current={m.id === selectedId.value ? "true" : undefined}
              data-testid={`mission-${m.id}`}
              onClick={() => selectMission(m.id)}
            >
              <b>{m.name}</b>
              <span class={`state ${m.state}`}>
                <span aria-hidden="true">{missionSign(m)}</span> {missionWords(m)}
              </span>
              <small>
                {capital(lengthWords(m.progress))} · {measuredWords(m.progress)}
              </small>
              <small>
                {new Date(m.created_at).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" })}
              </small>
            </a>
            {m.id === selectedId.value ? <Actions of={m} /> : null}
          </li>
        ))}
      </ul>
    </>
  );
}

/** What can be done with the mission that is shown: begin another one like it, or delete it while it holds nothing. */
function Actions({ of: { id, state, progress } }: { of: MissionSummary }) {
  const asked = useSignal(false);
  const empty = progress.step === 0 && progress.soundings + progress.pings + progress.rejected === 0;
  const atSea = state === "running" || state === "paused";
  const forbidden = whyNotCommand.value;
  return (
    <div class="mission-actions">
      <Button
        id="copy-mission"
        disabled={forbidden !== "" || mission.value?.id !== id}
        title={forbidden || "Describe a new mission that begins as a copy of this one"}
        onClick={() => {
          copied.value = mission.value;
          describing.value = true;
        }}
      >
        Same again
      </Button>
      {empty && (state === "draft" || state === "ready") ? (
        <Button
          id="edit-mission"
          disabled={forbidden !== "" || mission.value?.id !== id}
          title={forbidden || "Change the description, as long as nothing was flown"}
          onClick={() => {
            editedMission.value = mission.value;
            describing.value = true;
          }}
        >
          Edit
        </Button>
      ) : null}
      <Button
        id="export-mission"
        disabled={mission.value?.id !== id}
        title="The mission's description as one file, for another service or another day"
        onClick={() => {
          const shown = mission.value;
          if (shown) saveText(fileNameOf(shown.name), missionFile(shown.spec as unknown as NewMission));
        }}
      >
        Export
      </Button>
      {asked.value ? (
        <>
          <Button id="confirm-delete" onClick={() => void deleteMission(id)}>
            Delete it for good
          </Button>
          <Button onClick={sets(asked, false)}>Keep it</Button>
        </>
      ) : (
        <Button
          id="delete-mission"
          disabled={forbidden !== "" || !empty || atSea}
          title={forbidden || (empty && !atSea ? "" : "What was measured is kept")}
          onClick={sets(asked, true)}
        >
          Delete…
        </Button>
      )}
    </div>
  );
}
