import type { TargetState, TargetView } from "../../api/types";
import { age, direction, metres, plain, speed } from "../../state/format";
import type { Tone } from "../../state/stateNames";
import { mission } from "../../state/store";
import { say } from "../../words/say";

const WORDS: Record<TargetState, { words: string; sign: string; tone: Tone }> = {
  unheard: {
    get words() {
      return say("targets.notHeardYet");
    },
    sign: "◌",
    tone: "calm",
  },
  searching: {
    get words() {
      return say("targets.severalPlacesPossible");
    },
    sign: "?",
    tone: "warning",
  },
  uncertain: {
    get words() {
      return say("targets.notKnownWellEnough");
    },
    sign: "▲",
    tone: "warning",
  },
  accurate: {
    get words() {
      return say("targets.knownWell");
    },
    sign: "●",
    tone: "good",
  },
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
      aria-label={say("targets.target", { target: target.name })}
    >
      <header>
        <h2>{target.name}</h2>
        <span class={`tone ${tone}`}>
          <span aria-hidden="true">{sign}</span> {words}
        </span>
      </header>
      <dl class="big">
        <div>
          <dt>{say("targets.knownTo")}</dt>
          <dd data-testid={`target-sd-${target.name}`}>{worst === null ? "–" : `± ${metres(worst)}`}</dd>
        </div>
        <div>
          <dt>{say("fleet.depth")}</dt>
          <dd>{metres(target.depth_m)}</dd>
        </div>
        <div>
          <dt>{say("fleet.heard")}</dt>
          <dd>{age(target.age_s)}</dd>
        </div>
      </dl>
      <p class="small">
        {[
          say("targets.target2"),
          asked === undefined ? null : say("targets.askedM", { asked: plain(asked) }),
          target.in_area === null
            ? null
            : target.in_area
              ? say("targets.overTheArea")
              : say("targets.outsideTheArea"),
          target.speed_mps === null
            ? null
            : target.course_deg === null
              ? speed(target.speed_mps)
              : say("targets.speedTo", {
                  speed: speed(target.speed_mps),
                  courseDeg: direction(target.course_deg),
                }),
          say("targets.ranges", {
            ranges: target.ranges,
            it: target.rejected > 0 ? say("targets.notUsed", { rejected: target.rejected }) : "",
          }),
          target.pursued_by === null ? null : say("targets.goesForIt", { pursuedBy: target.pursued_by }),
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
