import type { TargetState, TargetView } from "../api/types";
import { age, metres } from "../state/format";
import { mission } from "../state/store";
import type { Tone } from "../state/words";

const WORDS: Record<TargetState, { words: string; sign: string; tone: Tone }> = {
  unheard: { words: "Not heard yet", sign: "◌", tone: "calm" },
  searching: { words: "Several places possible", sign: "?", tone: "warning" },
  uncertain: { words: "Not known well enough", sign: "▲", tone: "warning" },
  accurate: { words: "Known well", sign: "●", tone: "good" },
};

/** One card per moving target of the mission. */
export function TargetCards() {
  const targets = mission.value?.targets ?? [];
  return targets.map((target) => <TargetCard key={target.name} target={target} />);
}

function TargetCard({ target }: { target: TargetView }) {
  const { words, sign, tone } = WORDS[target.state];
  const asked = mission.value?.spec.tracking?.accuracy_m;
  const sds = [target.sd_east_m, target.sd_north_m, target.sd_depth_m].filter((sd) => sd !== null);
  const worst = sds.length > 0 ? Math.max(...sds) : null;
  return (
    <article
      class={`card target ${tone}`}
      data-testid={`target-${target.name}`}
      data-state={target.state}
      aria-label={`Target ${target.name}`}
    >
      <header>
        <h2>{target.name}</h2>
        <span class={`tone ${tone}`}>
          <span aria-hidden="true">{sign}</span> {words}
        </span>
      </header>
      <dl class="big">
        <div>
          <dt>Known to</dt>
          <dd data-testid={`target-sd-${target.name}`}>{worst === null ? "–" : `± ${metres(worst)}`}</dd>
        </div>
        <div>
          <dt>Depth</dt>
          <dd>{metres(target.depth_m)}</dd>
        </div>
        <div>
          <dt>Heard</dt>
          <dd>{age(target.age_s)}</dd>
        </div>
      </dl>
      <p class="small">
        {[
          "target",
          asked === undefined ? null : `asked ± ${asked} m`,
          target.in_area === null ? null : target.in_area ? "over the area" : "outside the area",
          target.speed_mps === null
            ? null
            : `${target.speed_mps.toFixed(1)} m/s to ${(target.course_deg ?? 0).toFixed(0)}°`,
          `${target.ranges} ranges${target.rejected > 0 ? `, ${target.rejected} not used` : ""}`,
          target.pursued_by === null ? null : `${target.pursued_by} goes for it`,
        ]
          .filter((part) => part !== null)
          .join(" · ")}
      </p>
      {target.state !== "accurate" && target.last_refusal ? (
        <p class="reason">{target.last_refusal}</p>
      ) : null}
    </article>
  );
}
