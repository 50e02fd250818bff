import "./TopBar.css";
import { whyNotCommand } from "../state/access";
import { linkAnnounced } from "../state/alarms/announced";
import { decidingFor } from "../state/alarms/waiting";
import { age, clock, duration } from "../state/format";
import { elapsedThen } from "../state/past/replay";
import { act, askAbort, busyWith } from "../state/session";
import {
  hasEnded,
  isAllowed,
  MISSION_WORDS,
  missionSign,
  missionWords,
  remaining_s,
  type Tone,
} from "../state/stateNames";
import {
  abortDialogOpen,
  abortOne,
  finishOpen,
  linksOpen,
  live,
  mission,
  now,
  panelOpen,
  preflightOpen,
  replayStep,
  STALE_AFTER_S,
  serviceNow,
  settingsOpen,
  socketStatus,
  vehicles,
  view,
} from "../state/store";
import { say } from "../words/say";
import { AccountButton } from "./Account";
import { Button, flips, sets } from "./parts/Controls";

export function TopBar() {
  const present = mission.value;
  const past = replayStep.value !== null;
  return (
    <header class="top-bar">
      <Button
        id="toggle-missions"
        kind="tool"
        title={say("missions.missions")}
        aria-label={say("missions.missions")}
        aria-expanded={panelOpen.value}
        aria-controls="missions"
        onClick={flips(panelOpen)}
      >
        ☰
      </Button>
      <Button
        id="open-links"
        kind="tool"
        title={say("topBar.linksWhatIsMissing")}
        aria-label={say("topBar.linksToVehicles")}
        onClick={sets(linksOpen, true)}
      >
        ⇄
      </Button>
      <div class="title">
        <h1 data-testid="mission-name">{present?.name ?? "bathyfleet"}</h1>
        {present ? <MissionLine /> : <p class="state">{say("topBar.noMissionChosen")}</p>}
      </div>
      <dl class="figures">
        {present ? (
          <>
            <Figure
              label={past ? say("topBar.decidedAfter") : say("topBar.elapsed")}
              value={duration(elapsed())}
              id="elapsed"
            />
            {present.ending ? null : (
              <Figure
                label={say("topBar.remaining")}
                value={
                  present.state === "running" && !past
                    ? duration(remaining_s(present.progress.eta_s, present.vehicles))
                    : "–"
                }
              />
            )}
          </>
        ) : null}
        <LinkSummary />
        <Figure label={say("topBar.utc")} value={clock(new Date(serviceNow.value), "utc")} minor />
        <Figure label={say("topBar.local")} value={clock(new Date(now.value), "local")} minor />
      </dl>
      <Button
        id="open-settings"
        kind="tool settings"
        title={say("settings.settings")}
        aria-label={say("settings.settings")}
        onClick={sets(settingsOpen, true)}
      >
        ⚙
      </Button>
      <AccountButton />
      {/* It has the keyboard while its buttons change. */}
      <div class="commands" tabIndex={-1} data-testid="commands">
        <WayForward />
        <StopNow />
      </div>
      <Button
        id="abort"
        kind="abort"
        disabled={!present || !isAllowed("abort", present) || whyNotCommand.value !== ""}
        title={
          !present
            ? say("topBar.noMissionIsChosen")
            : whyNotCommand.value
              ? whyNotCommand.value
              : isAllowed("abort", present)
                ? say("topBar.stopEveryVehicleOfThis")
                : say("topBar.thisMissionIsOver", {
                    becomes: MISSION_WORDS[present.state].toLowerCase(),
                  })
        }
        onClick={() => askAbort(null)}
      >
        {say("topBar.abortAll")}
      </Button>
    </header>
  );
}

/** The mission's state: as it was when the service is gone, and what its vehicles wait for. */
function MissionLine() {
  const present = mission.value;
  if (!present) return null;
  const isLive = live.value;
  const waiting = decidingFor.value;
  const words = missionWords(present);
  return (
    <p
      class={`state ${isLive ? present.state : "unknown"}${present.ending ? " ending" : ""}`}
      data-testid="mission-state"
      data-state={present.state}
      data-live={isLive}
      title={present.reason}
    >
      <span aria-hidden="true">{isLive ? missionSign(present) : "?"}</span>{" "}
      {isLive ? words : say("topBar.whenLastHeard", { words })}
      {isLive && waiting !== null ? (
        <span class="reason" data-testid="deciding">
          {" "}
          {say("topBar.planningStepForVehiclesWait", {
            step: present.progress.step + 1,
            waiting: duration(waiting),
          })}
        </span>
      ) : null}
      {present.reason ? <span class="reason"> · {present.reason}</span> : null}
    </p>
  );
}

/** Counts on between the service's messages, up to when it was last heard where the link does not stand. */
function elapsed(): number {
  const present = mission.value;
  if (!present) return 0;
  if (replayStep.value !== null) return elapsedThen.value ?? 0;
  const until = live.value ? now.value : view.value.vehiclesAt;
  const since_s = present.state === "running" ? Math.max(0, until - view.value.progressAt) / 1000 : 0;
  return present.progress.elapsed_s + since_s;
}

function Figure({
  label,
  value,
  minor = false,
  id,
}: {
  label: string;
  value: string;
  minor?: boolean;
  id?: string;
}) {
  return (
    <div class={minor ? "figure minor" : "figure"}>
      <dt>{label}</dt>
      <dd data-testid={id}>{value}</dd>
    </div>
  );
}

function LinkSummary() {
  const status = socketStatus.value;
  const team = vehicles.value.filter((v) => v.view.active);
  const heard = team.filter((v) => v.view.link === "ready" || v.view.link === "engaged").length;
  const all = team.length;
  if (!status) return null;
  let words: string;
  let tone: Tone = "warning";
  const { vehiclesAt } = view.value;
  const silent_s = vehiclesAt ? (now.value - vehiclesAt) / 1000 : 0;
  const old = vehiclesAt ? say("topBar.dataOld", { now: age(silent_s) }) : "";
  if (status.kind === "open" && mission.value && !live.value) {
    words = say("topBar.serviceSilent", { silent: age(silent_s) });
    tone = "alarm";
  } else if (status.kind === "open" && mission.value && hasEnded(mission.value)) {
    words = say("topBar.live");
    tone = "good";
  } else if (status.kind === "open" && mission.value) {
    words = say("topBar.liveOfVehicles", { heard, all });
    tone = heard < all ? "warning" : "good";
  } else if (status.kind === "waiting") {
    const wait = Math.max(0, Math.ceil((status.retryAt - now.value) / 1000));
    words = say("topBar.tryingAgainInS", { what: linkAnnounced.value, old, wait });
    tone = status.why === "missing" ? "warning" : "alarm";
  } else if (status.kind === "refused") {
    words = say("topBar.notSignedIn");
    tone = "alarm";
  } else {
    const stale = silent_s > STALE_AFTER_S;
    words = `${say("topBar.connecting")}${stale ? old : ""}`;
    if (stale) tone = "alarm";
  }
  return (
    <div class="figure">
      <dt>{say("fleet.link")}</dt>
      <dd class={`link ${tone}`}>
        <span aria-hidden="true">{tone === "good" ? "●" : tone === "alarm" ? "✕" : "◐"}</span>{" "}
        <span data-testid="link" data-status={status.kind}>
          {words}
        </span>
      </dd>
    </div>
  );
}

const WAYS = { start: "topBar.start", pause: "topBar.pause", resume: "topBar.resume" } as const;

/** What the mission's state allows, never more than one. Each is a button of its own: who presses twice does not undo it. */
function WayForward() {
  const present = mission.value;
  if (!present) return null;
  const [action] = (["start", "pause", "resume"] as const).filter(
    (one) => isAllowed(one, present) && !(one === "pause" && present.ending),
  );
  if (!action) return null;
  const label = say(WAYS[action]);
  return (
    <Button
      key={action}
      id={action}
      kind="command primary"
      commands
      busy={busyWith.value !== null}
      onClick={() => {
        if (action === "start") preflightOpen.value = true;
        else void act(action);
      }}
    >
      {busyWith.value === action ? `${label}…` : label}
    </Button>
  );
}

/** While vehicles are on their way home: they can be stopped where they are, which ends the mission now. */
function StopNow() {
  const ending = mission.value?.ending;
  if (!ending) return null;
  return (
    <Button
      id="stop-now"
      kind="command stop-now"
      commands
      title={say("topBar.stopTheVehiclesWhereTheyAre")}
      onClick={() => {
        if (ending === "finished") finishOpen.value = true;
        else {
          abortOne.value = null;
          abortDialogOpen.value = true;
        }
      }}
    >
      {say("abort.stopNow")}
    </Button>
  );
}
