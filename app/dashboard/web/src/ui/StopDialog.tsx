import "./StopDialog.css";
import { useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect } from "preact/hooks";
import type { ActionView, StopView } from "../api/types";
import { refusal, said } from "../state/session";
import { Button } from "./Controls";
import { Dialog } from "./Dialog";

interface StopDialogProps {
  open: boolean;
  onClose: () => void;
  name: "abort" | "finish";
  kind: string;
  above?: boolean;
  /** As a refusal of it names it. */
  what: string;
  question: string;
  done: string;
  send: () => Promise<ActionView | null>;
  confirm: (sending: boolean) => ComponentChildren;
  confirmId: string;
  /** What it means, before it is confirmed. */
  children: (sending: boolean) => ComponentChildren;
}

/** Asks once before vehicles are stopped, then stays until it has shown what every vehicle answered. */
export function StopDialog({ open, what, question, done, send, children, ...rest }: StopDialogProps) {
  const { confirm, confirmId, name, ...frame } = rest;
  const stops = useSignal<readonly StopView[] | null>(null);
  const sending = useSignal(false);
  useEffect(() => {
    if (open) stops.value = null;
  }, [open, what]);
  const stop = async () => {
    sending.value = true;
    try {
      const answer = await send();
      if (answer) stops.value = answer.stops;
    } finally {
      sending.value = false;
    }
  };
  const confirming = (
    <Button
      id={confirmId}
      kind={name === "abort" ? "abort" : "command primary"}
      disabled={sending.value}
      onClick={() => void stop()}
    >
      {confirm(sending.value)}
    </Button>
  );
  return (
    <Dialog
      {...frame}
      open={open}
      name={name}
      heading={stops.value ? done : question}
      fault={refusal.value?.what === what ? said(refusal.value.error) : ""}
      closing={stops.value ? "Close" : "Keep going"}
      actions={stops.value ? null : confirming}
    >
      {stops.value ? <Receipts stops={stops.value} /> : children(sending.value)}
    </Dialog>
  );
}

/** What every vehicle answered to a stop, and what to do about one that did not. */
function Receipts({ stops }: { stops: readonly StopView[] }) {
  return (
    <>
      <ul class="receipts" aria-live="polite">
        {stops.map((stop) => (
          <li
            key={stop.vehicle}
            class={stop.acknowledged ? "good" : "alarm"}
            data-testid={`receipt-${stop.vehicle}`}
          >
            <span>
              <span aria-hidden="true">{stop.acknowledged ? "✓" : "✕"}</span> <b>{stop.vehicle}</b>{" "}
              {stop.acknowledged ? "acknowledged the stop" : "did not acknowledge"}
              {stop.detail ? `: ${stop.detail}` : ""}
            </span>
          </li>
        ))}
      </ul>
      {stops.length === 0 ? <p>No vehicle was under way.</p> : null}
      {stops.some((stop) => !stop.acknowledged) ? (
        <p class="reason alarm">
          A vehicle that did not acknowledge may go on until its own time-out. Watch it, and stop it from its
          console if it does not surface.
        </p>
      ) : null}
    </>
  );
}
