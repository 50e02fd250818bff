import "./PreflightDialog.css";
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../api/client";
import type { CheckStatus, PreflightView } from "../api/types";
import { whyNotCommand } from "../state/access";
import { act, busyWith, refusal, said } from "../state/session";
import { mission, preflightOpen, selectedId } from "../state/store";
import { Dialog } from "./Dialog";
import { Forecast } from "./Forecast";

const SIGNS: Record<CheckStatus, string> = { ok: "✓", note: "•", warning: "▲", problem: "✕" };
const TONES: Record<CheckStatus, string> = { ok: "good", note: "calm", warning: "warning", problem: "alarm" };
const AGAIN_MS = 3000;

/** The checklist before a start; starts the mission when nothing stands in its way. */
export function PreflightDialog() {
  const found = useSignal<PreflightView | null>(null);
  const fault = useSignal("");
  const open = preflightOpen.value;

  useEffect(() => {
    if (!open) return;
    let stopped = false;
    const look = async () => {
      const id = selectedId.peek();
      if (!id) return;
      try {
        const answer = await api.preflight(id);
        if (!stopped) {
          found.value = answer;
          fault.value = "";
        }
      } catch (error) {
        fault.value = said(error);
      }
    };
    void look();
    const timer = setInterval(look, AGAIN_MS);
    return () => {
      stopped = true;
      clearInterval(timer);
      found.value = null;
    };
  }, [open]);

  const close = () => {
    preflightOpen.value = false;
  };
  const start = async () => {
    if (await act("start")) close();
  };
  const view = found.value;
  const problems = view?.checks.filter((c) => c.status === "problem").length ?? 0;
  const refused = refusal.value?.what === "start" ? refusal.value.error : null;
  return (
    <Dialog
      open={open}
      onClose={close}
      title="preflight-title"
      id="preflight"
      kind="preflight"
      data={{ "data-ready": view?.ready ?? "unknown" }}
    >
      <h2 id="preflight-title">Start {mission.value?.name ?? "the mission"}?</h2>
      {fault.value || refused ? (
        <p class="reason alarm" role="alert">
          {refused ? `${refused.message}. ${refused.remedy}` : fault.value}
        </p>
      ) : null}
      {view ? null : <p>Looking at the vehicles…</p>}
      <ul class="checklist">
        {view?.checks.map((check) => (
          <li key={check.id} data-testid={`check-${check.id}`} data-status={check.status}>
            <span class={`tone ${TONES[check.status]}`}>
              <span aria-hidden="true">{SIGNS[check.status]}</span>
              <span class="visually-hidden">{check.status}:</span>
            </span>
            <span>
              <b>{check.title}</b> {check.message}
              {check.remedy ? <span class={`remedy ${TONES[check.status]}`}> → {check.remedy}</span> : null}
            </span>
          </li>
        ))}
      </ul>
      {open && selectedId.value && mission.value?.spec.kind !== "search" ? (
        <Forecast of={selectedId.value} ask={(gone) => api.forecast(selectedId.peek() ?? "", gone)} />
      ) : null}
      <div class="dialog-actions">
        <button type="button" class="command" onClick={close} data-testid="preflight-close">
          Not yet
        </button>
        <button
          type="button"
          class="command primary"
          disabled={!view?.ready || busyWith.value !== null || whyNotCommand.value !== ""}
          title={whyNotCommand.value}
          data-testid="confirm-start"
          onClick={() => void start()}
        >
          {busyWith.value === "start"
            ? "Starting…"
            : problems > 0
              ? `${problems} problem${problems > 1 ? "s" : ""} to solve first`
              : "Start mission"}
        </button>
      </div>
    </Dialog>
  );
}
