import { count, distance, metres, percent } from "../state/format";
import { filesOpen, logOpen, mission, view } from "../state/store";
import { EventLog } from "./EventLog";
import { Files } from "./Files";

export function BottomStrip() {
  const present = mission.value;
  if (!present) return null;
  const p = present.progress;
  const newest = view.value.events.at(-1);
  return (
    <section class="bottom" aria-label="Progress and log">
      {logOpen.value ? <EventLog /> : null}
      {filesOpen.value ? <Files /> : null}
      <div class="strip">
        <div class="steps">
          <span>
            Step <b data-testid="step">{p.step}</b> of {p.steps}
          </span>
          <progress max={p.steps} value={p.step} aria-label="Steps done" />
        </div>
        <dl class="figures">
          <Figure
            label={`Known to ${present.spec.accuracy_m} m`}
            value={percent(p.coverage_pct, 1)}
            id="coverage"
          />
          <Figure label="Mean deviation" value={metres(p.mean_sd_m, 2)} id="mean-sd" />
          <Figure
            label="Soundings"
            value={`${count(p.soundings)}${p.rejected ? ` (${count(p.rejected)} rejected)` : ""}`}
            id="soundings"
          />
          <Figure label="Travelled" value={distance(p.distance_m)} id="distance" />
        </dl>
        <button
          type="button"
          class="log-toggle"
          aria-expanded={logOpen.value}
          data-testid="toggle-log"
          onClick={() => {
            logOpen.value = !logOpen.value;
            filesOpen.value = false;
          }}
        >
          <b>Log {logOpen.value ? "▾" : "▴"}</b>{" "}
          <span class="newest">{newest?.message ?? "nothing yet"}</span>
        </button>
        <button
          type="button"
          class="command"
          aria-expanded={filesOpen.value}
          data-testid="toggle-files"
          onClick={() => {
            filesOpen.value = !filesOpen.value;
            logOpen.value = false;
          }}
        >
          Files {filesOpen.value ? "▾" : "▴"}
        </button>
      </div>
    </section>
  );
}

function Figure({ label, value, id }: { label: string; value: string; id: string }) {
  return (
    <div class="figure">
      <dt>{label}</dt>
      <dd data-testid={id}>{value}</dd>
    </div>
  );
}
