import { count } from "../state/format";
import { selectMission } from "../state/session";
import { describing, fleetOpen, missions, selectedId, serviceFault } from "../state/store";
import { MISSION_SIGNS, MISSION_WORDS } from "../state/words";
import { NewMissionForm } from "./NewMissionForm";

export function MissionPanel() {
  return (
    <aside class="panel missions" id="missions" aria-label="Missions">
      {describing.value ? <NewMissionForm /> : <MissionList />}
    </aside>
  );
}

function MissionList() {
  const list = missions.value;
  return (
    <>
      <header class="panel-head">
        <h2>Missions</h2>
        <button
          type="button"
          class="command"
          data-testid="open-fleet"
          onClick={() => {
            fleetOpen.value = true;
          }}
        >
          Fleet
        </button>
        <button
          type="button"
          class="command"
          data-testid="new-mission"
          onClick={() => {
            describing.value = true;
          }}
        >
          + New
        </button>
      </header>
      {list === null && !serviceFault.value ? <p class="empty">Asking the service…</p> : null}
      {list?.length === 0 ? (
        <p class="empty">
          No mission yet. <b>+ New</b> describes one: an area, vehicles, and how many steps to take. Without a
          vehicle at hand choose simulated ones.
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
                <span aria-hidden="true">{MISSION_SIGNS[m.state]}</span> {MISSION_WORDS[m.state]}
              </span>
              <small>
                Step {m.progress.step} of {m.progress.steps} · {count(m.progress.soundings)} soundings
              </small>
              <small>
                {new Date(m.created_at).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" })}
              </small>
            </a>
          </li>
        ))}
      </ul>
    </>
  );
}
