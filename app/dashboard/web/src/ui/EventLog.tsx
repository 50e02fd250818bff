import { useSignal } from "@preact/signals";
import type { Level } from "../api/types";
import { clock } from "../state/format";
import { openAlarms, takeAlarms, view } from "../state/store";

const SIGNS: Record<Level, string> = { info: "·", warning: "▲", alarm: "✕" };
const MOST_SHOWN = 300;

/** The mission's log, newest first. */
export function EventLog() {
  const important = useSignal(false);
  const lines = view.value.events.filter((e) => !important.value || e.level !== "info").slice(-MOST_SHOWN);
  return (
    <div class="log" data-testid="log">
      <label class="check">
        <input
          type="checkbox"
          checked={important.value}
          onChange={(event) => {
            important.value = event.currentTarget.checked;
          }}
        />
        Only warnings and alarms
      </label>
      {lines.length === 0 ? <p class="empty">Nothing to show.</p> : null}
      <ol>
        {lines.reverse().map((event) => (
          <li key={event.id} class={event.level}>
            <time dateTime={event.time}>{clock(new Date(event.time), "utc")}</time>
            <span aria-hidden="true">{SIGNS[event.level]}</span>
            <span class="kind">{event.kind}</span>
            <span class="message">{event.message}</span>
          </li>
        ))}
      </ol>
    </div>
  );
}

/** Alarms stay over the map until someone takes them. */
export function Alarms() {
  const alarms = openAlarms.value;
  const newest = alarms[0];
  if (!newest) return null;
  return (
    <section class="alarms" role="alert" data-testid="alarms">
      <p>
        <b>✕ {clock(new Date(newest.time), "utc")} UTC</b> {newest.message}
        {alarms.length > 1 ? <small> and {alarms.length - 1} more in the log</small> : null}
      </p>
      <button type="button" class="command" onClick={takeAlarms} data-testid="take-alarms">
        Taken
      </button>
    </section>
  );
}
