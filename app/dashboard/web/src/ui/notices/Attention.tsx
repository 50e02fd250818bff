import "./Attention.css";
import { useComputed, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import { alarmSound, followAlarms } from "../../state/alarms/alarmSound";
import { type Matter, mattersOf, toldWords } from "../../state/alarms/attention";
import { clock, minutes } from "../../state/format";
import { showWhere } from "../../state/past/whereabouts";
import { mission, openAlarms, replayStep, serviceNow, takenAlarm } from "../../state/store";
import { say, sayWith } from "../../words/say";
import { Button, flips } from "../parts/Controls";
import { take, takeAlarms, takeFault } from "./acknowledge";

const TOLD_PERIOD_MS = 10_000;
const SHOWN = 2;
const SIGNS = { alarm: "✕", warning: "▲", calm: "◌" };

/** One glance tells what needs a person: over the map on every page, alarms until someone takes them. */
export function Attention() {
  // Alarms are of now, whatever step of the past is shown.
  const matters = useComputed(() =>
    mattersOf(replayStep.value === null ? mission.value : null, openAlarms.value),
  );
  const open = useSignal(false);
  useEffect(() => followAlarms(), []);
  const alarms = openAlarms.value;
  const shown = open.value ? matters.value : matters.value.slice(0, alarms.length > 0 ? SHOWN : 1);
  const rest = matters.value.length - shown.length;
  if (shown.length === 0) return <Taken />;
  return (
    <>
      <section
        class={`attention ${shown[0]?.tone}`}
        aria-label={say("attention.needsAttention")}
        data-testid="attention"
      >
        <ul data-testid={alarms.length > 0 ? "alarms" : undefined}>
          {shown.map((matter) => (
            <Line key={matter.key} matter={matter} onTake={(id) => void take([id])} />
          ))}
        </ul>
        {takeFault.value ? <p class="fault">{takeFault.value}</p> : null}
        <div class="attention-does">
          {rest > 0 || open.value ? (
            <Button id="attention-more" kind="link-button" aria-expanded={open.value} onClick={flips(open)}>
              {open.value ? say("attention.less") : say("attention.more", { rest })}
            </Button>
          ) : null}
          {alarms.length > 0 ? (
            <>
              <Button
                id="alarm-sound"
                kind="link-button"
                aria-pressed={alarmSound.value}
                title={say("attention.onThisDeviceOnly")}
                onClick={flips(alarmSound)}
              >
                {alarmSound.value ? say("attention.mute") : say("attention.soundOn")}
              </Button>
              <Button
                id="take-alarms"
                commands
                title={say("attention.sayThatYouSeeToIt")}
                onClick={() => void takeAlarms()}
              >
                {alarms.length > 1 ? say("attention.takeAll", { count: alarms.length }) : say("log.taken")}
              </Button>
            </>
          ) : null}
        </div>
      </section>
      <Taken />
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
            {sayWith("attention.since", {
              time: (
                <time dateTime={new Date(m.since).toISOString()}>
                  {clock(new Date(m.since), "utc").slice(0, 5)}
                </time>
              ),
              ago: minutes(Math.max(serviceNow.value - m.since, 0) / 1000),
            })}{" "}
          </>
        )}
        {m.todo === "" ? null : say("attention.whatToDo", { todo: m.todo })}{" "}
        {m.alarm ? <Told id={m.alarm.id} /> : null}{" "}
        {m.vehicle ? (
          <Button kind="link-button" onClick={() => void showWhere(m.vehicle as string, m.since)}>
            {say("attention.where")}
          </Button>
        ) : null}{" "}
        {m.alarm ? (
          <Button kind="link-button" commands onClick={() => onTake(m.alarm?.id ?? "")}>
            {say("attention.takeIt")}
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
      {say("log.utcTook", {
        it: clock(new Date(taken.acknowledged_at), "utc"),
        acknowledgedBy: taken.acknowledged_by ?? "",
        message: taken.message,
      })}
    </p>
  );
}
