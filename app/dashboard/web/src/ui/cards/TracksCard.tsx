import "./CrosslinesCard.css";
import "./TracksCard.css";
import { useSignal, useSignalEffect } from "@preact/signals";
import { api } from "../../api/client";
import type { AdjustmentView, TieView } from "../../api/types";
import { aboutCrossing } from "../../map/marks/crossings";
import { tiesIn } from "../../map/marks/ties";
import { count, dayAndTime, fixed, metres } from "../../state/format";
import { said } from "../../state/session";
import { destination, mission, selectedId } from "../../state/store";
import { say } from "../../words/say";
import { Button } from "../parts/Controls";

/** Pixels of the picture of ties, and of the room about it. */
const [WIDTH, ROOM] = [260, 6];

const OUTCOMES: Record<TieView["outcome"], string> = {
  get used() {
    return say("tracks.used");
  },
  get "no-overlap"() {
    return say("tracks.noOverlap");
  },
  get flat() {
    return say("tracks.flat");
  },
  get misfit() {
    return say("tracks.misfit");
  },
  get outlier() {
    return say("tracks.outlier");
  },
  get "not-significant"() {
    return say("tracks.notSignificant");
  },
};

/** By how much tracks were moved for their vehicles' drift, by what, and how well they agree since. */
export function TracksCard() {
  const answer = useSignal<AdjustmentView | null>(null);
  const busy = useSignal("");
  const fault = useSignal("");
  useSignalEffect(() => {
    selectedId.value;
    answer.value = null;
    fault.value = "";
  });
  const { soundings = 0, pings = 0 } = mission.value?.progress ?? {};
  if (soundings + pings === 0) return null;

  const ask = async (words: string, what: (id: string) => Promise<AdjustmentView>) => {
    const id = selectedId.peek();
    if (!id) return;
    busy.value = words;
    fault.value = "";
    try {
      const found = await what(id);
      if (selectedId.peek() === id) answer.value = found;
    } catch (error) {
      fault.value = said(error);
    } finally {
      busy.value = "";
    }
  };

  const found = answer.value;
  const working = busy.value !== "";
  return (
    <article
      class="card target crosslines tracks"
      data-testid="tracks-card"
      aria-label={say("tracks.driftOfTracks")}
    >
      <header>
        <h2>{say("tracks.driftOfTracks")}</h2>
      </header>
      {found ? <Told found={found} /> : null}
      <p class="row">
        {found ? null : (
          <Button
            id="look-at-tracks"
            busy={working}
            onClick={() => ask(say("tracks.looking"), api.adjustment)}
          >
            {say("tracks.lookAtThem")}
          </Button>
        )}
        {found ? (
          <Button
            id="adjust-tracks"
            commands
            busy={working}
            onClick={() => ask(say("tracks.adjusting"), api.adjust)}
          >
            {found.applied ? say("tracks.adjustAgain") : say("tracks.adjust")}
          </Button>
        ) : null}
        {found?.applied ? (
          <Button
            id="undo-adjustment"
            commands
            busy={working}
            onClick={() => ask(say("tracks.undoing"), api.undoAdjustment)}
          >
            {say("tracks.undo")}
          </Button>
        ) : null}
      </p>
      {working ? (
        <p class="small" role="status">
          {busy.value}
        </p>
      ) : null}
      {fault.value ? (
        <p class="problem small" role="alert">
          {fault.value}
        </p>
      ) : null}
    </article>
  );
}

function Told({ found }: { found: AdjustmentView }) {
  const { held_out } = found;
  return (
    <>
      <p class="small" data-testid="adjustment">
        {!found.applied
          ? say("tracks.asTheyCame")
          : say(found.by_ties ? "tracks.byTiesAndFixes" : "tracks.byFixes", {
              ties: count(found.ties_used),
              fixes: count(found.fixes),
              actor: found.actor ?? "",
              at: found.made_at === null ? "" : dayAndTime(new Date(found.made_at)),
            })}
      </p>
      {found.applied ? <Moved found={found} /> : null}
      {found.before_m !== null && found.after_m !== null ? (
        <p class="small" data-testid="ties-agree">
          {say("tracks.overlapsDiffer", {
            before: metres(found.before_m, 2),
            after: metres(found.after_m, 2),
          })}
        </p>
      ) : null}
      {held_out ? (
        <p class="small">
          {say("tracks.heldOut", {
            before: metres(held_out.before_m, 2),
            fixes: metres(held_out.by_fixes_m, 2),
            after: metres(held_out.after_m, 2),
          })}
        </p>
      ) : null}
      <Ties found={found} />
    </>
  );
}

function Moved({ found }: { found: AdjustmentView }) {
  return (
    <table>
      <thead>
        <tr>
          <th scope="col">{say("tracks.metres")}</th>
          <th scope="col">{say("tracks.moved")}</th>
          <th scope="col">{say("tracks.atMost")}</th>
          <th scope="col">{say("tracks.sdBefore")}</th>
          <th scope="col">{say("tracks.sdAfter")}</th>
        </tr>
      </thead>
      <tbody>
        {found.tracks.map((track) => (
          <tr key={track.vehicle}>
            <th scope="row">{track.vehicle}</th>
            <td>{fixed(track.mean_m, 1)}</td>
            <td>{fixed(track.max_m, 1)}</td>
            <td>{fixed(track.before_sd_m, 1)}</td>
            <td>{fixed(track.sd_m, 1)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

/** Where sections of tracks were compared with what others sounded there: used, or why not. */
function Ties({ found }: { found: AdjustmentView }) {
  const { height, drawn } = tiesIn(found, WIDTH - 2 * ROOM);
  if (drawn.length === 0) return null;
  return (
    <figure>
      <figcaption>
        {say("tracks.sections", { used: count(found.ties_used), others: count(found.ties_rejected) })}
      </figcaption>
      <svg
        viewBox={`${-ROOM} ${-ROOM} ${WIDTH} ${height + 2 * ROOM}`}
        role="img"
        aria-label={say("tracks.pictureOfSections")}
        data-testid="ties"
      >
        {drawn.map(({ x, y, place, tie }) => (
          // biome-ignore lint/a11y/noStaticElementInteractions: a short cut for the mouse; the map is moved by keys, too
          <circle
            key={tie.number}
            class={tie.outcome === "used" ? "used" : "unused"}
            cx={x}
            cy={y}
            r={3}
            onClick={() => {
              destination.value = aboutCrossing({ lon_deg: place[0], lat_deg: place[1] });
            }}
          >
            <title>{aboutTie(tie)}</title>
          </circle>
        ))}
      </svg>
    </figure>
  );
}

function aboutTie({ vehicle, other, outcome, before_m, after_m }: TieView): string {
  const who = other === null ? vehicle : `${vehicle} – ${other}`;
  const residuals = before_m === null ? "" : ` ${metres(before_m, 2)} → ${metres(after_m, 2)}`;
  return `${who}: ${OUTCOMES[outcome]}${residuals}`;
}
