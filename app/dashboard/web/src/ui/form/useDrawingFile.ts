import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { api, ServiceError } from "../../api/client";
import type { DrawingView } from "../../api/types";
import { reasonOf } from "../../state/session";

/** A file of lines and areas that the service reads, and what it asks of it. */
export interface DrawingFile {
  busy: boolean;
  /** What is wrong with it; empty: nothing. */
  fault: string;
  /** Whether it does not say what its positions are in. */
  asksCrs: boolean;
  read: (file: File) => void;
  /** Reads the same file once more, its positions being in this system. */
  readIn: (crs: string) => void;
  stop: () => void;
}

/** Takes what a file holds, with the file's name. */
export type OnDrawing = (drawing: DrawingView, name: string) => void;

export function useDrawingFile(onDrawing: OnDrawing): DrawingFile {
  const file = useRef<File | null>(null);
  const gone = useRef<AbortController | null>(null);
  const busy = useSignal(false);
  const fault = useSignal("");
  const asksCrs = useSignal(false);
  const stop = () => gone.current?.abort();
  useEffect(() => stop, []);
  const send = async (crs: string) => {
    const sent = file.current;
    if (!sent) return;
    stop();
    const going = new AbortController();
    gone.current = going;
    busy.value = true;
    fault.value = "";
    try {
      const found = await api.readDrawing(crs, { file: sent, onBytes: () => {}, gone: going.signal });
      if (going.signal.aborted) return;
      asksCrs.value = false;
      onDrawing(found, sent.name);
    } catch (error) {
      if (going.signal.aborted) return;
      const faults = error instanceof ServiceError ? error.faults : [];
      asksCrs.value = faults.some(({ field }) => field.endsWith("crs"));
      fault.value = reasonOf(error);
    } finally {
      if (gone.current === going) busy.value = false;
    }
  };
  return {
    busy: busy.value,
    fault: fault.value,
    asksCrs: asksCrs.value,
    read: (chosen) => {
      file.current = chosen;
      asksCrs.value = false;
      void send("");
    },
    readIn: (crs) => void send(crs),
    stop,
  };
}
