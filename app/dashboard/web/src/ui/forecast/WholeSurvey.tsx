import type { PlanView } from "../../api/types";
import { distance, duration } from "../../state/format";
import { say } from "../../words/say";

type Whole = NonNullable<PlanView["whole_survey"]>;

/** What it takes until nothing is left to ensonify, whatever the mission's length is. */
export function WholeSurvey({ whole }: { whole: Whole }) {
  const figures = {
    length: between(whole.distance_m_range, distance),
    time: between(whole.duration_s_range, duration),
  };
  return (
    <p class={whole.within_budget ? "hint" : "reason"} data-testid="whole-survey">
      {whole.within_budget ? say("planned.whole", figures) : say("planned.wholeBeyond", figures)}
      {": "}
      {whole.vehicles.map(partOf).join(" · ")}
    </p>
  );
}

function partOf({ vehicle, distance_m, duration_s, batteries }: Whole["vehicles"][number]): string {
  const part = { vehicle, way: distance(distance_m), time: duration(duration_s) };
  return batteries === null || batteries < 2
    ? say("planned.wholeOf", part)
    : say("planned.wholeOfBatteries", { ...part, batteries });
}

/** "low to high" where they differ as they are shown. */
function between({ low, high }: { low: number; high: number }, shown: (value: number) => string): string {
  const [a, b] = [shown(low), shown(high)];
  return a === b ? a : say("forecast.to", { low: a, high: b });
}
