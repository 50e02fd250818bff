import "./Attention.css";
import { useComputed, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../api/client";
import { alarmSound, followAlarms } from "../state/alarmSound";
import { type Matter, mattersOf, toldWords } from "../state/attention";
import { clock, minutes } from "../state/format";
import { said } from "../state/session";
import { mission, now, openAlarms, replayStep, takenAlarm } from "../state/store";
import { showWhere } from "../state/whereabouts";
import { Button, flips } from "./Controls";

const TOLD_PERIOD_MS = 10_000;
const SHOWN = 2;
const SIGNS = { alarm: "✕", warning: "▲", calm: "◌" };

/** One glance tells what needs a person: over the map on every page, alarms until someone takes them. */
export function Attention() {
  const matters = useComputed(() =>
    replayStep.value === null ? mattersOf(mission.value, openAlarms.value) : [],
  );
  const open = useSignal(false);
  const fault = useSignal("");
  useEffect(() => followAlarms(), []);
  const alarms = openAlarms.value;
  const shown = open.value ? matters.value : matters.value.slice(0, alarms.length > 0 ? SHOWN : 1);
  const rest = matters.value.length - shown.length;
  if (shown.length === 0) return <Taken />;
  const take = async (ids: readonly string[]) => {
    try {
      await Promise.all(ids.map((id) => api.acknowledge(id)));
      fault.value = "";
    } catch (error) {
      fault.value = said(error);
    }
  };
  return (
    <>
      <section
        class={`attention ${shown[0]?.tone}`}
        aria-label="Needs attention"
        data-testid="attention"
        {...(alarms.length > 0 ? { role: "alert" } : {})}
      >
        <ul data-testid={alarms.length > 0 ? "alarms" : undefined}>
          {shown.map((matter) => (
            <Line key={matter.key} matter={matter} onTake={(id) => void take([id])} />
          ))}
        </ul>
        {fault.value ? <p class="fault">{fault.value}</p> : null}
        <div class="attention-does">
          {rest > 0 || open.value ? (
            <Button id="attention-more" kind="link-button" aria-expanded={open.value} onClick={flips(open)}>
              {open.value ? "Less" : `${rest} more`}
            </Button>
          ) : null}
          {alarms.length > 0 ? (
            <>
              <Button
                id="alarm-sound"
                kind="link-button"
                aria-pressed={alarmSound.value}
                title="On this device only"
                onClick={flips(alarmSound)}
              >
                {alarmSound.value ? "Mute" : "Sound on"}
              </Button>
              <Button
                id="take-alarms"
                commands
                title="Say that you see to it: nobody else is called for these alarms"
                onClick={() => void take(alarms.map(({ id }) => id))}
              >
                {alarms.length > 1 ? `Take all ${alarms.length}` : "Taken"}
              </Button>
            </>
          ) : null}
        </div>
      </section>
      {alarms.length === 0 ? <Taken /> : null}
    </>
  );
}

function Line({ matter: m, onTake }: { matter: Matter; onTake: (id: string) => void }) {
  return (
    <li class={m.tone} data-testid={`matter-${m.key.replaceAll(" ", "-")}`}>
      <p>
        <span aria-hidden="true">{SIGNS[m.tone]}</span> <b>{m.what}</b>
      </p>
      <p class="small">
        {m.since === null ? null : (
          <>
            Since{" "}
            <time dateTime={new Date(m.since).toISOString()}>
              {clock(new Date(m.since), "utc").slice(0, 5)}
            </time>{" "}
            UTC ({minutes(Math.max(now.value - m.since, 0) / 1000)}).{" "}
          </>
        )}
        {m.todo === "" ? null : <>What to do: {m.todo}.</>} {m.alarm ? <Told id={m.alarm.id} /> : null}{" "}
        {m.vehicle ? (
          <Button kind="link-button" onClick={() => void showWhere(m.vehicle as string, m.since)}>
            Where
          </Button>
        ) : null}{" "}
        {m.alarm ? (
          <Button kind="link-button" commands onClick={() => onTake(m.alarm?.id ?? "")}>
            Take it
          </Button>
        ) : null}
      </p>
    </li>
  );
}

/** Who else was told of an alarm. */
function Told({ id }: { id: string }) {
  const words = useSignal("");
  useEffect(() => {
    const ask = () =>
      api
        .alarm(id)
        .then((report) => {
          words.value = toldWords(report);
        })
        .catch(() => {
          // The service is gone, which the live socket tells of.
        });
    void ask();
    const timer = setInterval(() => void ask(), TOLD_PERIOD_MS);
    return () => clearInterval(timer);
  }, [id]);
  return words.value === "" ? null : <span data-testid="alarm-told">{words.value}.</span>;
}

/** Who took the last alarm, for a moment, so that nobody else sets out for it. */
function Taken() {
  const taken = takenAlarm.value;
  if (!taken?.acknowledged_at) return null;
  return (
    <p class="notice" role="status" data-testid="taken-alarm">
      {clock(new Date(taken.acknowledged_at), "utc")} UTC: {taken.acknowledged_by} took “{taken.message}”
    </p>
  );
}
