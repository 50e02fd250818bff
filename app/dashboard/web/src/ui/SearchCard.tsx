import { duration, percent } from "../state/format";
import { mission } from "../state/store";
import { hasEnded, type Tone } from "../state/words";

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
    <article class={`card target ${tone}`} data-testid="search-card" aria-label="Search">
      <header>
        <h2>Search</h2>
        <span class={`tone ${tone}`} data-testid="search-state">
          <span aria-hidden="true">{sign}</span> {words}
        </span>
      </header>
      <dl class="big">
        <div>
          <dt>Goal area</dt>
          <dd data-testid="goal-seen">{percent(search.goal_pct)}</dd>
        </div>
        <div>
          <dt>Site</dt>
          <dd data-testid="site-seen">{percent(search.explored_pct)}</dd>
        </div>
        <div>
          <dt>{search.left_s < 0 ? "Late by" : "Time left"}</dt>
          <dd data-testid="time-left">{ended ? "–" : duration(Math.abs(search.left_s))}</dd>
        </div>
      </dl>
      <p class="small">
        {[
          `${search.back.length} of ${vehicles} at the entry`,
          search.out_of_contact.length > 0 ? `out of contact: ${search.out_of_contact.join(", ")}` : null,
          `${search.version} scans`,
          search.found_cells > 0 ? `obstacles found on ${search.found_cells} cells` : null,
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
      ? { words: "Everybody is back", sign: "●", tone: "good" }
      : { words: "Not everybody is back", sign: "✕", tone: "alarm" };
  }
  if (!begun) return { words: "Not begun", sign: "◌", tone: "calm" };
  if (left_s < 0 && !allBack) return { words: "Too late", sign: "✕", tone: "alarm" };
  if (left_s < SHORT * window_s && !allBack) return { words: "Time is short", sign: "▲", tone: "warning" };
  return { words: "In time", sign: "●", tone: "good" };
}
