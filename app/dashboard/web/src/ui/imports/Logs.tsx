import { useComputed, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import type { LogView } from "../../api/types";
import { whyNotCommand } from "../../state/access";
import { count, dayAndTime, percent } from "../../state/format";
import { said } from "../../state/session";
import { mission, selectedId } from "../../state/store";
import { isNameless, queuedOf, sendLogs, underWay } from "../../state/uploads";
import { say } from "../../words/say";
import { AskedTwice, FilesButton, Trouble, Typed } from "../parts/Controls";
import { Sendings } from "./Sendings";

/** How often it is asked what became of logs, while one is read and otherwise. */
const SOON_MS = 1000;
const LATER_MS = 10_000;

/** Vehicles' own logs: those that were imported, how far others are, and sending one. */
export function Logs() {
  const logs = useSignal<readonly LogView[] | null>(null);
  const fault = useSignal("");
  const missing = useSignal("");
  const vehicle = useSignal("");
  const names = useComputed(() => (mission.value?.vehicles ?? []).map(({ name }) => name));
  const id = selectedId.value;

  /** Change something first, if anything, then look. */
  const look = async (change?: (id: string) => Promise<unknown>) => {
    if (!id) return;
    try {
      await change?.(id);
      logs.value = await api.logs(id);
      fault.value = "";
    } catch (error) {
      fault.value = said(error);
    }
  };
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout> | undefined;
    let gone = false;
    const again = async () => {
      await look();
      if (!gone) timer = setTimeout(() => void again(), underWay(logs.peek() ?? []) ? SOON_MS : LATER_MS);
    };
    void again();
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [id]);

  const send = (files: File[]) => {
    const whose = vehicle.peek().trim();
    const nameless = files.find(({ name }) => isNameless(name));
    missing.value = nameless && !whose ? say("imports.nameTheVehicle", { name: nameless.name }) : "";
    if (id && !missing.value) void sendLogs(id, whose, files, () => void look());
  };
  const listed = [...(logs.value ?? [])].reverse();
  return (
    <section aria-label={say("imports.logs")}>
      <h3>{say("imports.logs")}</h3>
      <p class="hint">{say("imports.whatLogsAre")}</p>
      {whyNotCommand.value ? null : (
        <>
          <div class="fields">
            <label class="field">
              {say("log.vehicle")}
              <Typed
                text={vehicle}
                id="log-vehicle"
                placeholder={say("imports.asTheLogSays")}
                maxLength={64}
                list="log-vehicles"
              />
            </label>
            <datalist id="log-vehicles">
              {names.value.map((name) => (
                <option key={name} value={name} />
              ))}
            </datalist>
          </div>
          <p class="row">
            <FilesButton id="log-file" several onFiles={send}>
              {say("imports.sendLogs")}
            </FilesButton>
          </p>
        </>
      )}
      <Trouble words={missing.value || fault.value} />
      <Sendings purpose="log" />
      {queuedOf(id).length > 0 ? (
        <p role="status" data-testid="logs-queued">
          {say("imports.queued", { names: queuedOf(id).join(", ") })}
        </p>
      ) : null}
      <ul data-testid="logs">
        {listed.map((log) => (
          <li key={log.id} data-state={log.state}>
            <Log log={log} onTakeBack={() => void look((of) => api.deleteLog(of, log.id))} />
          </li>
        ))}
      </ul>
      {logs.value?.length === 0 ? <p class="empty">{say("imports.noLog")}</p> : null}
    </section>
  );
}

function Log({ log, onTakeBack }: { log: LogView; onTakeBack: () => void }) {
  const { file, vehicle, created_at, result, state, problem, remedy, read_bytes, size_bytes } = log;
  const asked = useSignal(false);
  const ended = state === "done" || state === "failed";
  return (
    <>
      <b>{file}</b>
      {vehicle ? `, ${vehicle}` : ""}, {dayAndTime(new Date(created_at))}
      {log.actor ? `, ${log.actor}` : ""}
      {state === "waiting" ? <p role="status">{say("imports.waits")}</p> : null}
      {state === "reading" ? (
        <p role="status">
          {say("imports.read", { read: percent((100 * (read_bytes ?? 0)) / (size_bytes || 1)) })}
        </p>
      ) : null}
      {state === "failed" ? <Trouble words={[problem, remedy].filter(Boolean).join(". ")} /> : null}
      {state === "taken-back" ? (
        <p data-testid="log-taken-back">
          {say("imports.takenBack", {
            who: log.taken_back_by,
            when: log.taken_back_at ? dayAndTime(new Date(log.taken_back_at)) : "",
          })}
        </p>
      ) : null}
      {result && state !== "taken-back" ? <Result result={result} /> : null}
      {whyNotCommand.value || !log.can_be_taken_back ? null : (
        <p class="row">
          <AskedTwice
            asked={asked}
            first={{
              id: "log-delete",
              commands: true,
              onClick: () => {
                asked.value = true;
              },
              children: say(ended ? "imports.takeBack" : "imports.stop"),
            }}
            last={{
              id: "log-delete-really",
              commands: true,
              onClick: () => {
                asked.value = false;
                onTakeBack();
              },
              children: say(ended ? "imports.takeLogBackReally" : "imports.stopReally"),
            }}
            keep={{ children: say(ended ? "imports.keep" : "imports.readOn") }}
          />
        </p>
      )}
    </>
  );
}

type Counted = NonNullable<LogView["result"]>;

function Result({ result }: { result: Counted }) {
  const { soundings, rejected, duplicate, pings, pings_rejected, pings_duplicate } = result;
  const why = [...Object.entries(result.reasons), ...Object.entries(result.refused)].sort(
    ([, a], [, b]) => b - a,
  );
  const unreadable = Object.values(result.unreadable).reduce((sum, one) => sum + one, 0);
  return (
    <>
      {soundings + rejected + duplicate > 0 || pings + pings_rejected + pings_duplicate === 0 ? (
        <p data-testid="log-soundings">
          {say("imports.soundings", {
            accepted: count(soundings),
            rejected: count(rejected),
            known: count(duplicate),
          })}
        </p>
      ) : null}
      {pings + pings_rejected + pings_duplicate > 0 ? (
        <p data-testid="log-pings">
          {say("imports.pings", {
            accepted: count(pings),
            rejected: count(pings_rejected),
            known: count(pings_duplicate),
          })}
        </p>
      ) : null}
      {result.known ? <p class="quiet">{say("imports.nothingNew")}</p> : null}
      <ul class="small">
        {why.map(([reason, times]) => (
          <li key={reason}>
            {count(times)} × {reason}
          </li>
        ))}
        {unreadable > 0 ? <li>{say("imports.unreadable", { count: unreadable })}</li> : null}
        {result.cut_off ? <li>{say("imports.cutOff")}</li> : null}
        {result.notes.map((note) => (
          <li key={note}>{note}</li>
        ))}
      </ul>
    </>
  );
}
