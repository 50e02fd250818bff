import "./EventLog.css";
import { useComputed, useSignal } from "@preact/signals";
import { api } from "../../api/client";
import type { EventView, Level } from "../../api/types";
import { clock, daysOf } from "../../state/format";
import { vehicleOf } from "../../state/past/placeThen";
import { showEvent } from "../../state/past/whereabouts";
import { said } from "../../state/session";
import { selectedId, serviceNow, view } from "../../state/store";
import { say } from "../../words/say";
import { Button, Choice, into, same, Typed } from "../parts/Controls";

const SIGNS: Record<Level, string> = { info: "·", warning: "▲", alarm: "✕" };
const MOST_SHOWN = 300;
const NOTE_FORM = "note-form";
/** Which lines are shown. */
const choices = () =>
  [
    ["all", say("log.allLines")],
    ["important", say("log.warningsAndAlarms")],
    ["notes", say("log.notes")],
  ] as const;

/** The mission's log, newest first, with a field for what the next watch should know. */
export function EventLog() {
  const least = useSignal<ReturnType<typeof choices>[number][0]>("all");
  const kind = useSignal("");
  const words = useSignal("");
  const vehicle = useSignal("");
  const named = useComputed(() => [...new Set(view.value.events.flatMap((e) => vehicleOf(e) ?? []))].sort());
  const kinds = useComputed(() => [...new Set(view.value.events.map((e) => e.kind))].sort());
  const wanted = words.value.trim().toLowerCase();
  const found = view.value.events
    .filter((e) => least.value !== "important" || e.level !== "info")
    .filter((e) => least.value !== "notes" || e.kind === "note")
    .filter((e) => kind.value === "" || e.kind === kind.value)
    .filter((e) => vehicle.value === "" || vehicleOf(e) === vehicle.value)
    .filter((e) => wanted === "" || `${e.message} ${e.kind}`.toLowerCase().includes(wanted))
    .reverse();
  const lines = found.slice(0, MOST_SHOWN);
  const days = daysOf(
    lines.map(({ time }) => time),
    serviceNow.value,
  );
  return (
    <div class="log" data-testid="log">
      <NoteForm />
      <div class="filters">
        <Choice
          label={say("log.whichLines")}
          value={least.value}
          options={choices()}
          id="log-level"
          onChoose={into(least)}
        />
        <Choice
          label={say("log.kindOfLine")}
          value={kind.value}
          options={[["", say("log.everyKind")], ...same(kinds.value)]}
          onChoose={into(kind)}
        />
        <Choice
          label={say("log.vehicle")}
          value={vehicle.value}
          options={[["", say("log.everyVehicle")], ...same(named.value)]}
          id="log-vehicle"
          onChoose={into(vehicle)}
        />
        <Typed
          text={words}
          type="search"
          label={say("log.wordsInTheLine")}
          placeholder={say("log.words")}
          id="log-words"
        />
      </div>
      {lines.length === 0 ? <p class="empty">{say("log.noLineIsLikeThat")}</p> : null}
      <ol aria-label={say("log.logNewestFirst")}>
        {lines.map((event, i) => (
          <li key={event.id} class={`${event.level}${event.kind === "note" ? " note" : ""}`}>
            {days[i] == null ? null : <b class="day">{days[i]}</b>}
            <time
              dateTime={event.time}
              title={say("log.local", { it: clock(new Date(event.time), "local") })}
            >
              {clock(new Date(event.time), "utc")}
            </time>
            <span aria-hidden="true">{SIGNS[event.level]}</span>
            <span class="kind">{event.kind}</span>
            <span class="message">
              {hasPlace(event) ? (
                <Button
                  kind="log-line"
                  id={`where-${event.id}`}
                  title={say("log.showOnTheMap")}
                  onClick={() => void showEvent(event)}
                >
                  {event.message}
                </Button>
              ) : (
                event.message
              )}
              {event.kind === "note" && event.data.actor ? <small> {String(event.data.actor)}</small> : null}
            </span>
          </li>
        ))}
      </ol>
      {found.length > MOST_SHOWN ? <p class="empty">{say("log.olderLines", { shown: MOST_SHOWN })}</p> : null}
    </div>
  );
}

const hasPlace = (event: EventView) => vehicleOf(event) !== null || typeof event.data.lat_deg === "number";

function NoteForm() {
  const text = useSignal("");
  const fault = useSignal("");
  const sending = useSignal(false);
  const write = async () => {
    const id = selectedId.value;
    const note = text.value.trim();
    if (!id || note === "" || sending.peek()) return;
    sending.value = true;
    try {
      await api.note(id, note);
      // What is typed meanwhile is the next one.
      if (text.peek().trim() === note) text.value = "";
      fault.value = "";
    } catch (error) {
      fault.value = said(error);
    } finally {
      sending.value = false;
    }
  };
  return (
    <form
      id={NOTE_FORM}
      class="note-form"
      onSubmit={(event) => {
        event.preventDefault();
        void write();
      }}
    >
      <Typed
        text={text}
        label={say("log.noteForTheLog")}
        placeholder={say("log.noteForTheNextWatch")}
        maxLength={2000}
        id="note"
      />
      <Button
        id="write-note"
        commands
        disabled={text.value.trim() === ""}
        busy={sending.value}
        form={NOTE_FORM}
      >
        {say("log.writeDown")}
      </Button>
      {fault.value ? (
        <span class="fault" role="alert">
          {fault.value}
        </span>
      ) : null}
    </form>
  );
}
