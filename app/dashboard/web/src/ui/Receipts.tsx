import "./Receipts.css";
import type { StopView } from "../api/types";

/** What every vehicle answered to a stop, and what to do about one that did not. */
export function Receipts({ stops }: { stops: readonly StopView[] }) {
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
