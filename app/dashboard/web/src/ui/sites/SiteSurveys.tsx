import "./SiteSurveys.css";
import type { ChangesView, SurveyView } from "../../api/types";
import { day, fixed } from "../../state/format";
import { say, sayWith } from "../../words/say";

/** The surveys of a site whose depths it has, one a line. */
export function SiteSurveys({ surveys }: { surveys: readonly SurveyView[] }) {
  return (
    <ul class="surveys" data-testid="surveys">
      {surveys.map((survey) => (
        <li key={survey.mission_id}>
          {sayWith("site.ofTheSite", {
            b: <b>{survey.name}</b>,
            it: survey.ended_at ? day(new Date(survey.ended_at)) : "",
            sharePct: fixed(survey.share_pct, 0),
            it2:
              survey.median_sd_m === null ? "" : say("site.m", { medianSdM: fixed(survey.median_sd_m, 2) }),
          })}
          {survey.left_out ? <small> {say("site.leftOut", { leftOut: survey.left_out })}</small> : null}
        </li>
      ))}
    </ul>
  );
}

/** What changed between two surveys, in words. */
export function SiteChanges({ found }: { found: ChangesView }) {
  const volume = ({ m3, sd_m3 }: ChangesView["lost"]) => `${fixed(m3, 0)} ± ${fixed(sd_m3, 0)} m³`;
  return (
    <p class="changes" data-testid="changes">
      {say("site.fromToChangedIsChanceWent", {
        earlier: found.earlier.name,
        later: found.later.name,
        significantPct: fixed(found.significant_pct, 1),
        expectedPct: fixed(found.expected_pct, 0),
        lost: volume(found.lost),
        gained: volume(found.gained),
      })}
    </p>
  );
}
