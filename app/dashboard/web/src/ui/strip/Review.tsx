import "./Review.css";
import { useComputed, useSignal, useSignalEffect } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import type { SoundingState, SoundingView } from "../../api/types";
import { metres } from "../../state/format";
import { said } from "../../state/session";
import { chosenSounding, mission, reviewed, selectedId, view } from "../../state/store";
import { say } from "../../words/say";
import { Button, Choice, into, Typed } from "../parts/Controls";
import { BeamEdits } from "./BeamEdits";

const WORDS: Record<SoundingState, string> = {
  get used() {
    return say("review.used");
  },
  get restored() {
    return say("review.restored");
  },
  get rejected() {
    return say("review.keptOutByTheGate");
  },
  get doubted() {
    return say("review.leftOutByTheMap");
  },
  get withdrawn() {
    return say("review.keptOutByAnOperator");
  },
};

/** Soundings that are not in the map, with the reason; an operator may let them count, and take that back. */
export function Review() {
  const filter = useSignal<"" | SoundingState>("");
  const total = useSignal(0);
  const next = useSignal<number | null>(null);
  const fault = useSignal("");
  const busy = useSignal(0);
  const note = useSignal("");

  const load = async (after: number) => {
    const id = selectedId.peek();
    if (!id) return;
    try {
      const page = await api.soundings(id, after, filter.peek() || undefined);
      if (selectedId.peek() !== id) return;
      reviewed.value = after === 0 ? page.items : [...(reviewed.peek() ?? []), ...page.items];
      total.value = page.total;
      next.value = page.next_after;
    } catch (error) {
      fault.value = said(error);
    }
  };
  // What the map leaves out changes with the map.
  const version = useComputed(() => view.value.mapVersion);
  useSignalEffect(() => {
    filter.value;
    version.value;
    void load(0);
  });
  useEffect(
    () => () => {
      reviewed.value = null;
      chosenSounding.value = null;
    },
    [],
  );
  const rule = async (sounding: SoundingView, ruling: "restore" | "reject") => {
    const id = selectedId.value;
    if (!id) return;
    busy.value = sounding.id;
    fault.value = "";
    try {
      const changed = await api.rule(id, sounding.id, ruling, note.value.trim());
      reviewed.value = (reviewed.value ?? []).map((s) => (s.id === changed.id ? changed : s));
      note.value = "";
    } catch (error) {
      fault.value = said(error);
    } finally {
      busy.value = 0;
    }
  };
  const items = reviewed.value ?? [];
  return (
    <div class="log review" data-testid="review">
      <div class="filters">
        <Choice
          label={say("review.whichSoundings")}
          value={filter.value}
          options={[
            ["", say("review.everythingThatIsNotSimply")],
            ...(["rejected", "doubted", "withdrawn", "restored", "used"] as const).map(
              (state) => [state, WORDS[state]] as const,
            ),
          ]}
          id="review-filter"
          onChoose={into(filter)}
        />
        <Typed
          text={note}
          label={say("review.whyKeptInTheLog")}
          placeholder={say("review.whyKeptInTheLog2")}
          maxLength={500}
          id="review-note"
        />
        <span>{say("review.sounding", { total: total.value })}</span>
      </div>
      {(mission.value?.progress.pings ?? 0) > 0 ? <BeamEdits /> : null}
      {fault.value ? (
        <p class="alarm" role="alert" data-testid="review-fault">
          ✕ {fault.value}
        </p>
      ) : null}
      {items.length === 0 ? <p class="empty">{say("review.everySoundingSoFarIsIn")}</p> : null}
      <ol aria-label={say("bottomStrip.soundings")}>
        {items.map((s) => (
          <Row key={s.id} sounding={s} busy={busy.value === s.id} onRule={rule} />
        ))}
      </ol>
      {next.value !== null ? (
        <Button onClick={() => load(next.value ?? 0)}>{say("review.more")}</Button>
      ) : null}
    </div>
  );
}

interface RowProps {
  sounding: SoundingView;
  busy: boolean;
  onRule: (sounding: SoundingView, ruling: "restore" | "reject") => void;
}

function Row({ sounding: s, busy, onRule }: RowProps) {
  const counts = s.state === "restored" || s.state === "used";
  const chosen = chosenSounding.value === s.id;
  return (
    <li
      class={chosen ? "chosen" : ""}
      data-testid={`sounding-${s.id}`}
      data-state={s.state}
      ref={(element) => {
        if (chosen) element?.scrollIntoView({ block: "nearest" });
      }}
    >
      <Button
        kind="link-button"
        title={say("review.showItOnTheMap")}
        onClick={() => {
          chosenSounding.value = s.id;
        }}
      >
        {s.vehicle} #{s.id}
      </Button>
      <b>{metres(s.depth_m ?? s.raw_depth_m, 2)}</b>
      <span class="message">
        {WORDS[s.state]}
        {s.reason ? <small>: {s.reason}</small> : null}
      </span>
      <Button
        id={`rule-${s.id}`}
        commands
        busy={busy}
        onClick={() => onRule(s, counts ? "reject" : "restore")}
      >
        {busy ? "…" : counts ? say("review.reject") : say("review.restore")}
      </Button>
    </li>
  );
}
