import type { MissionAction } from "../api/types";
import { age, clock, duration } from "../state/format";
import { act, busyWith } from "../state/session";
import {
  abortDialogOpen,
  abortOne,
  linksOpen,
  mission,
  now,
  panelOpen,
  preflightOpen,
  socketStatus,
  theme,
  vehicles,
  view,
} from "../state/store";
import { isAllowed, MISSION_SIGNS, MISSION_WORDS, type Tone } from "../state/words";

export function TopBar() {
  const present = mission.value;
  return (
    <header class="top-bar">
      <button
        type="button"
        class="tool"
        aria-label="Missions"
        aria-expanded={panelOpen.value}
        aria-controls="missions"
        title="Missions"
        data-testid="toggle-missions"
        onClick={() => {
          panelOpen.value = !panelOpen.value;
        }}
      >
        ☰
      </button>
      <button
        type="button"
        class="tool"
        aria-label="Links to vehicles"
        title="Links: what is missing"
        data-testid="open-links"
        onClick={() => {
          linksOpen.value = true;
        }}
      >
        ⇄
      </button>
      <div class="title">
        <h1 data-testid="mission-name">{present?.name ?? "bathyfleet"}</h1>
        {present ? (
          <p
            class={`state ${present.state}`}
            data-testid="mission-state"
            data-state={present.state}
            title={present.reason}
          >
            <span aria-hidden="true">{MISSION_SIGNS[present.state]}</span> {MISSION_WORDS[present.state]}
            {present.reason ? <span class="reason"> · {present.reason}</span> : null}
          </p>
        ) : (
          <p class="state">No mission chosen</p>
        )}
      </div>
      <dl class="figures">
        {present ? (
          <>
            <Figure label="Elapsed" value={duration(elapsed())} />
            <Figure
              label="Remaining"
              value={present.state === "running" ? duration(present.progress.eta_s) : "–"}
            />
          </>
        ) : null}
        <LinkSummary />
        <Figure label="UTC" value={clock(new Date(now.value), "utc")} minor />
        <Figure label="Local" value={clock(new Date(now.value), "local")} minor />
      </dl>
      <ThemeSwitch />
      <div class="commands">
        <Command action="start" label="Start" />
        <Command action="pause" label="Pause" />
        <Command action="resume" label="Resume" />
        <Command action="finish" label="Finish" />
      </div>
      <button
        type="button"
        class="abort"
        data-testid="abort"
        disabled={!present || !isAllowed("abort", present.state)}
        title={
          !present
            ? "No mission is chosen"
            : isAllowed("abort", present.state)
              ? "Stop every vehicle of this mission"
              : `This mission is over: ${MISSION_WORDS[present.state].toLowerCase()}`
        }
        onClick={() => {
          abortOne.value = null;
          abortDialogOpen.value = true;
        }}
      >
        Abort all
      </button>
    </header>
  );
}

/** Counts on between the service's messages while the link stands. */
function elapsed(): number {
  const present = mission.value;
  if (!present) return 0;
  const counting = present.state === "running" && socketStatus.value?.kind === "open";
  return present.progress.elapsed_s + (counting ? Math.max(0, now.value - view.value.progressAt) / 1000 : 0);
}

function Figure({ label, value, minor = false }: { label: string; value: string; minor?: boolean }) {
  return (
    <div class={minor ? "figure minor" : "figure"}>
      <dt>{label}</dt>
      <dd>{value}</dd>
    </div>
  );
}

function LinkSummary() {
  const status = socketStatus.value;
  const heard = vehicles.value.filter((v) => v.view.link === "ready" || v.view.link === "engaged").length;
  const all = vehicles.value.length;
  if (!status) return null;
  let words: string;
  let tone: Tone = "warning";
  if (status.kind === "open" && mission.value) {
    words = `Live · ${heard} of ${all} vehicles`;
    tone = heard < all ? "warning" : "good";
  } else if (status.kind === "waiting") {
    const wait = Math.max(0, Math.ceil((status.retryAt - now.value) / 1000));
    const old = view.value.vehiclesAt ? `, data ${age((now.value - view.value.vehiclesAt) / 1000)} old` : "";
    words = `Service gone${old}; trying again in ${wait} s`;
    tone = "alarm";
  } else {
    words = "Connecting…";
  }
  return (
    <div class="figure">
      <dt>Link</dt>
      <dd class={`link ${tone}`}>
        <span aria-hidden="true">{tone === "good" ? "●" : tone === "alarm" ? "✕" : "◐"}</span>{" "}
        <span role="status" data-testid="link" data-status={status.kind}>
          {words}
        </span>
      </dd>
    </div>
  );
}

/** Shown only when the state allows it, so that there is never more than one way forward. */
function Command({ action, label }: { action: MissionAction; label: string }) {
  const state = mission.value?.state;
  if (!state || !isAllowed(action, state)) return null;
  return (
    <button
      type="button"
      class={action === "finish" ? "command" : "command primary"}
      data-testid={action}
      disabled={busyWith.value !== null}
      onClick={() => {
        if (action === "start") preflightOpen.value = true;
        else void act(action);
      }}
    >
      {busyWith.value === action ? `${label}…` : label}
    </button>
  );
}

const NEXT_THEME = { system: "light", light: "dark", dark: "contrast", contrast: "system" } as const;
const THEME_SIGNS = { system: "◐", light: "☀", dark: "☾", contrast: "◼" } as const;

function ThemeSwitch() {
  const words = `Colours: ${theme.value}. Change to ${NEXT_THEME[theme.value]}`;
  return (
    <button
      type="button"
      class="tool theme"
      aria-label={words}
      title={words}
      data-testid="theme"
      onClick={() => {
        theme.value = NEXT_THEME[theme.value];
      }}
    >
      {THEME_SIGNS[theme.value]}
    </button>
  );
}
