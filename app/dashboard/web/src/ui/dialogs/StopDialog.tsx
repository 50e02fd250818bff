import "./StopDialog.css";
import { useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { ServiceError } from "../../api/client";
import type { ActionView, StopView } from "../../api/types";
import { refusal, said } from "../../state/session";
import { MISSION_WORDS } from "../../state/stateNames";
import { live } from "../../state/store";
import { say } from "../../words/say";
import { Button } from "../parts/Controls";
import { Dialog } from "../parts/Dialog";

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
  /** Brings vehicles home first, beside what stops them now; undefined where none can. */
  sendHome?: (() => Promise<ActionView | null>) | undefined;
  /** What it means, before it is confirmed. */
  children: (sending: boolean) => ComponentChildren;
}

/** Asks once before vehicles are stopped, then stays until it has shown what every vehicle answered. */
export function StopDialog({
  open,
  what,
  question,
  done,
  send,
  sendHome,
  children,
  ...rest
}: StopDialogProps) {
  const { confirm, confirmId, name, ...frame } = rest;
  const answer = useSignal<ActionView | null>(null);
  const sending = useSignal<"stop" | "home" | null>(null);
  // An answer counts for what was asked last: one that comes late takes no stop out of reach.
  const last = useRef(0);
  useEffect(() => {
    last.current++;
    answer.value = null;
    sending.value = null;
  }, [open, what]);
  const ask = async (which: "stop" | "home", how: () => Promise<ActionView | null>) => {
    last.current++;
    const mine = last.current;
    sending.value = which;
    try {
      const found = await how();
      if (mine === last.current) answer.value = found;
    } finally {
      if (mine === last.current) sending.value = null;
    }
  };
  const stopping = sending.value === "stop";
  // Whoever hears nothing of a stop asks again: it stays in reach.
  const waiting = stopping && live.value;
  const confirming = (
    <>
      {sendHome ? (
        <Button
          id={`${name}-return`}
          busy={sending.value !== null}
          onClick={() => void ask("home", sendHome)}
        >
          {say("abort.returnHome")}
        </Button>
      ) : null}
      <Button
        id={confirmId}
        kind={name === "abort" ? "abort" : "command primary"}
        busy={waiting}
        onClick={() => void ask("stop", send)}
      >
        {confirm(waiting)}
      </Button>
    </>
  );
  const ending = answer.value?.mission.ending;
  return (
    <Dialog
      {...frame}
      asks
      open={open}
      name={name}
      heading={ending ? say("stop.returningHome") : answer.value ? done : question}
      fault={
        sending.value !== null && !live.value
          ? say("stop.serviceDoesNotAnswer")
          : refusal.value?.what === what
            ? stopFault(refusal.value.error)
            : ""
      }
      closing={answer.value ? say("dialog.close") : say("stop.keepGoing")}
      actions={answer.value ? null : confirming}
    >
      {ending ? (
        <p data-testid={`${name}-returning`}>
          {say("stop.theVehiclesAreOnTheirWay", { becomes: MISSION_WORDS[ending].toLowerCase() })}
        </p>
      ) : answer.value ? (
        <Receipts stops={answer.value.stops} />
      ) : (
        children(stopping)
      )}
    </Dialog>
  );
}

/** Why there is no answer to a stop. */
const stopFault = (error: ServiceError): string =>
  error.status === 0 ? say("stop.serviceDoesNotAnswer") : said(error);

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
              {stop.acknowledged ? say("stop.acknowledgedTheStop") : say("stop.didNotAcknowledge")}
              {stop.detail ? `: ${stop.detail}` : ""}
            </span>
          </li>
        ))}
      </ul>
      {stops.length === 0 ? <p>{say("stop.noVehicleWasUnderWay")}</p> : null}
      {stops.some((stop) => !stop.acknowledged) ? (
        <p class="reason alarm">{say("stop.aVehicleThatDidNot")}</p>
      ) : null}
    </>
  );
}
