import { duration, percent } from "../../state/format";
import { hasEnded, type Tone } from "../../state/stateNames";
import { mission } from "../../state/store";
import { say } from "../../words/say";

/** Time is short below this share of the window. */
const SHORT = 0.15;

/** How a search stands: what was seen, the time that is left, who is back and who cannot be reached. */
export function SearchCard() {
  const search = mission.value?.progress.search;
  const spec = mission.value?.spec.search;
  if (!mission.value || !search || !spec) return null;
  const vehicles = mission.value.vehicles.length;
  const allBack = search.back.length >= vehicles;
  const ended = hasEnded(mission.value);
  const { words, sign, tone } = verdict(
    search.left_s,
    spec.window_s,
    allBack,
    ended,
    search.began_at !== null,
  );
  return (
    <article class={`card target ${tone}`} data-testid="search-card" aria-label={say("mission.search")}>
      <header>
        <h2>{say("mission.search")}</h2>
        <span class={`tone ${tone}`} data-testid="search-state">
          <span aria-hidden="true">{sign}</span> {words}
        </span>
      </header>
      <dl class="big">
        <div>
          <dt>{say("search.goalArea")}</dt>
          <dd data-testid="goal-seen">{percent(search.goal_pct)}</dd>
        </div>
        <div>
          <dt>{say("search.site")}</dt>
          <dd data-testid="site-seen">{percent(search.explored_pct)}</dd>
        </div>
        <div>
          <dt>{search.left_s < 0 ? say("search.lateBy") : say("search.timeLeft")}</dt>
          <dd data-testid="time-left">{ended ? "–" : duration(Math.abs(search.left_s))}</dd>
        </div>
      </dl>
      <p class="small">
        {[
          say("search.ofAtTheEntry", { back: search.back.length, vehicles }),
          search.out_of_contact.length > 0
            ? say("search.outOfContact", { outOfContact: search.out_of_contact.join(", ") })
            : null,
          say("search.scans", { version: search.version }),
          search.found_cells > 0
            ? say("search.obstaclesFoundOnCells", { foundCells: search.found_cells })
            : null,
        ]
          .filter((part) => part !== null)
          .join(" · ")}
      </p>
    </article>
  );
}

function verdict(
  left_s: number,
  window_s: number,
  allBack: boolean,
  ended: boolean,
  begun: boolean,
): { words: string; sign: string; tone: Tone } {
  if (ended) {
    return allBack
      ? { words: say("search.everybodyIsBack"), sign: "●", tone: "good" }
      : { words: say("search.notEverybodyIsBack"), sign: "✕", tone: "alarm" };
  }
  if (!begun) return { words: say("search.notBegun"), sign: "◌", tone: "calm" };
  if (left_s < 0 && !allBack) return { words: say("search.tooLate"), sign: "✕", tone: "alarm" };
  if (left_s < SHORT * window_s && !allBack)
    return { words: say("search.timeIsShort"), sign: "▲", tone: "warning" };
  return { words: say("search.inTime"), sign: "●", tone: "good" };
}
