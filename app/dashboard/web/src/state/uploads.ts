/** Files that are on their way to the service: they go on while the pane that sent them is closed. */

import { signal } from "@preact/signals";
import { api, type Sending, ServiceError } from "../api/client";
import type { LogView } from "../api/types";
import { said } from "./session";

/** Where a file goes. */
export type Purpose = "log" | "import" | "reference";

/** A file that is being sent, or was and was refused. */
export interface Upload {
  key: number;
  mission: string;
  purpose: Purpose;
  name: string;
  size: number;
  sent: number;
  /** Why it was refused; empty while it is on its way. */
  fault: string;
  stop: () => void;
}

export const uploads = signal<readonly Upload[]>([]);

/** Those of a mission and purpose. */
export const uploadsOf = (mission: string | null, purpose: Purpose): readonly Upload[] =>
  uploads.value.filter((one) => one.mission === mission && one.purpose === purpose);

let last = 0;

/** Sends a file and shows how far it is; the answer, or null where it was stopped or refused, which stays shown. */
export async function sendFile<T>(
  mission: string,
  purpose: Purpose,
  file: File,
  send: (sending: Sending) => Promise<T>,
): Promise<T | null> {
  last += 1;
  const key = last;
  const gone = new AbortController();
  const others = () => uploads.peek().filter((one) => one.key !== key);
  const change = (changed: Partial<Upload>) => {
    uploads.value = uploads.peek().map((one) => (one.key === key ? { ...one, ...changed } : one));
  };
  // What was refused before is read by now.
  const shown = uploads
    .peek()
    .filter((one) => !(one.fault && one.mission === mission && one.purpose === purpose));
  const begun: Upload = {
    key,
    mission,
    purpose,
    name: file.name,
    size: file.size,
    sent: 0,
    fault: "",
    stop: () => gone.abort(),
  };
  uploads.value = [...shown, begun];
  try {
    const answer = await send({ file, onBytes: (sent) => change({ sent }), gone: gone.signal });
    uploads.value = others();
    return answer;
  } catch (error) {
    if (gone.signal.aborted) uploads.value = others();
    else change({ fault: said(error) });
    return null;
  }
}

/** Forgets why a file was refused. */
export function dismiss(key: number): void {
  uploads.value = uploads.peek().filter((one) => one.key !== key);
}

const MULTIBEAM = /\.(gsf|kmall)$/i;

/** Whether a log does not say whose it is, as its name tells. */
export const isNameless = (name: string): boolean => MULTIBEAM.test(name);

const isUnderWay = ({ state }: LogView) => state === "waiting" || state === "reading";

/** Whether the service reads one of these, or is about to. */
export const underWay = (logs: readonly LogView[]): boolean => logs.some(isUnderWay);

const LOOK_MS = 1000;

/** Logs that are sent when those before them have been read, by mission; the page still has them. */
const queued = signal<readonly { mission: string; name: string }[]>([]);

/** Names of the logs of a mission that are not on their way yet. */
export const queuedOf = (mission: string | null): readonly string[] =>
  queued.value.filter((one) => one.mission === mission).map(({ name }) => name);

/** Whether leaving the page would lose files that were chosen. */
export const wouldBeLost = (): boolean =>
  queued.peek().length > 0 || uploads.peek().some(({ fault }) => !fault);

/** Has the browser ask before the page is left while files are on their way. */
export function askBeforeLeaving(): void {
  window.addEventListener("beforeunload", (event) => {
    if (wouldBeLost()) event.preventDefault();
  });
}

/** Sends logs one after the other, each when the service has read the one before; ends where one is stopped or refused. */
export async function sendLogs(
  mission: string,
  vehicle: string,
  files: readonly File[],
  onLog: () => void,
): Promise<void> {
  let left = files.map(({ name }) => ({ mission, name }));
  const keep = (now: typeof left) => {
    const before = new Set(left);
    queued.value = [...queued.peek().filter((one) => !before.has(one)), ...now];
    left = now;
  };
  try {
    for (const file of files) {
      keep(left.slice(1));
      const sent = await sendFile(mission, "log", file, (sending) => api.sendLog(mission, vehicle, sending));
      onLog();
      if (sent === null) return;
      if (file === files.at(-1)) return;
      while (await isNotRead(mission, sent.id)) await new Promise((resolve) => setTimeout(resolve, LOOK_MS));
    }
  } finally {
    keep([]);
  }
}

/** Whether the service is not yet done with a log; where it does not answer, too: it may again. */
async function isNotRead(mission: string, id: string): Promise<boolean> {
  try {
    return (await api.logs(mission)).some((log) => log.id === id && isUnderWay(log));
  } catch (error) {
    // Where nobody is signed in, or the mission is there no more, it will not be told.
    return !(error instanceof ServiceError && [401, 403, 404].includes(error.status));
  }
}
