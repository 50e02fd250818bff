import "./MissionPanel.css";
import { useSignal } from "@preact/signals";
import { useLayoutEffect, useRef } from "preact/hooks";
import type { MissionSummary, NewMission } from "../api/types";
import { whyNotCommand } from "../state/access";
import { fileNameOf, missionFile } from "../state/form/missionFile";
import { dayAndTime } from "../state/format";
import { deleteMission, selectMission } from "../state/session";
import {
  capital,
  hasEnded,
  lengthWords,
  measuredWords,
  missionSign,
  missionWords,
} from "../state/stateNames";
import {
  copied,
  describing,
  editedMission,
  fleetOpen,
  listsLive,
  mission,
  missions,
  panelOpen,
  selectedId,
  serviceFault,
  sitesOpen,
} from "../state/store";
import { say, sayWith } from "../words/say";
import { panelWidth } from "./chart/layout";
import { NewMissionForm } from "./form/NewMissionForm";
import { AskedTwice, Button, sets } from "./parts/Controls";
import { saveText } from "./parts/download";
import { Grip } from "./parts/Grip";

export function MissionPanel() {
  const panel = useRef<HTMLElement>(null);
  const wasDescribing = useRef(false);
  // What had the focus goes when the form comes, and with the form: it is on the heading of what is there instead.
  useLayoutEffect(() => {
    const isOther = describing.value || wasDescribing.current;
    wasDescribing.current = describing.value;
    if (isOther) panel.current?.querySelector("h2")?.focus({ preventScroll: true });
  }, [describing.value]);
  return (
    <aside
      ref={panel}
      class="panel missions"
      id="missions"
      aria-label={say("missions.missions")}
      // What is being described is kept.
      hidden={!panelOpen.value}
    >
      <div class="panel-scroll">{describing.value ? <NewMissionForm /> : <MissionList />}</div>
      <Grip
        what={say("missions.theMissions")}
        size={panelWidth}
        side="right"
        least={240}
        most={640}
        id="grip-missions"
      />
    </aside>
  );
}

function MissionList() {
  const list = missions.value;
  return (
    <>
      <header class="panel-head">
        <h2 tabIndex={-1}>{say("missions.missions")}</h2>
        <Button id="open-fleet" onClick={sets(fleetOpen, true)}>
          {say("fleet.fleet")}
        </Button>
        <Button id="open-sites" onClick={sets(sitesOpen, true)}>
          {say("site.sites")}
        </Button>
        <Button id="new-mission" commands onClick={sets(describing, true)}>
          {say("missions.new")}
        </Button>
      </header>
      {list === null && !serviceFault.value ? <p class="empty">{say("missions.askingTheService")}</p> : null}
      {list?.length === 0 ? (
        <p class="empty">
          {sayWith("missions.noMissionYetDescribesOneAn", { b: <b>{say("missions.new")}</b> })}
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
              <State of={m} />
              <small>
                {capital(lengthWords(m.progress))} · {measuredWords(m.progress)}
              </small>
              <small>{dayAndTime(new Date(m.created_at))}</small>
              <Follows of={m} />
            </a>
            {m.id === selectedId.value ? <Actions of={m} /> : null}
          </li>
        ))}
      </ul>
    </>
  );
}

/** What a mission is at, or was when the service was last heard; one that has ended stays as it is. */
function State({ of: m }: { of: MissionSummary }) {
  const known = listsLive.value || hasEnded(m);
  const words = missionWords(m);
  return (
    <span class={`state ${known ? m.state : "unknown"}`} data-testid={`listed-${m.id}`}>
      <span aria-hidden="true">{known ? missionSign(m) : "?"}</span>{" "}
      {known ? words : say("topBar.whenLastHeard", { words })}
    </span>
  );
}

/** The mission that another one waits for. */
function Follows({ of: { after, state } }: { of: MissionSummary }) {
  const before = missions.value?.find(({ id }) => id === after);
  if (!before || state !== "ready" || hasEnded(before)) return null;
  return <small data-testid="follows">{say("blocks.after", { name: before.name })}</small>;
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
        title={forbidden || say("missions.describeANewMissionThat")}
        onClick={() => {
          copied.value = mission.value;
          describing.value = true;
        }}
      >
        {say("missions.sameAgain")}
      </Button>
      {empty && (state === "draft" || state === "ready") ? (
        <Button
          id="edit-mission"
          disabled={forbidden !== "" || mission.value?.id !== id}
          title={forbidden || say("missions.changeTheDescriptionAsLongAs")}
          onClick={() => {
            editedMission.value = mission.value;
            describing.value = true;
          }}
        >
          {say("missions.edit")}
        </Button>
      ) : null}
      <Button
        id="export-mission"
        disabled={mission.value?.id !== id}
        title={say("missions.theMissionSDescriptionAsOne")}
        onClick={() => {
          const shown = mission.value;
          if (shown) saveText(fileNameOf(shown.name), missionFile(shown.spec as unknown as NewMission));
        }}
      >
        {say("beginnings.export")}
      </Button>
      <AskedTwice
        asked={asked}
        first={{
          id: "delete-mission",
          disabled: forbidden !== "" || !empty || atSea,
          title: forbidden || (empty && !atSea ? "" : say("missions.whatWasMeasuredIsKept")),
          onClick: sets(asked, true),
          children: say("missions.delete"),
        }}
        last={{
          id: "confirm-delete",
          onClick: () => void deleteMission(id),
          children: say("missions.deleteItForGood"),
        }}
        keep={{ id: "keep-mission", children: say("missions.keepIt") }}
      />
    </div>
  );
}
