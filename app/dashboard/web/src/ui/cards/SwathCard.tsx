import "./SwathCard.css";
import { aboutHoliday } from "../../map/marks/swath";
import { area, count, percent, place } from "../../state/format";
import { coordinateFormat, destination, holidays, mission } from "../../state/store";
import { say } from "../../words/say";
import { Button } from "../parts/Controls";

/** More are on the map and in the file. */
const MOST_LISTED = 100;

/** How far a swath survey has come, and where it missed something. */
export function SwathCard() {
  const progress = mission.value?.progress;
  if (!progress || progress.holidays === null) return null;
  const found = holidays.value?.features ?? [];
  return (
    <article class="card target" data-testid="swath-card" aria-label={say("swath.ensonifiedAndMissed")}>
      <header>
        <h2>{say("swath.ensonifiedAndMissed")}</h2>
      </header>
      <dl class="big">
        <div title={say("swath.shareOfTheAreaSCells")}>
          <dt>{say("bottomStrip.ensonified")}</dt>
          <dd>{percent(progress.ensonified_pct, 1)}</dd>
        </div>
        <div title={say("swath.shareOfTheAreaSCells2")}>
          <dt>{say("compare.dense")}</dt>
          <dd>{percent(progress.dense_pct, 1)}</dd>
        </div>
        <div title={say("swath.groundOfAtLeastThreeBy")}>
          <dt>{say("bottomStrip.holidays")}</dt>
          <dd data-testid="holiday-count">{count(progress.holidays)}</dd>
        </div>
      </dl>
      {found.length > 0 ? (
        <ol class="holidays" aria-label={say("swath.holidaysLargestFirst")}>
          {found.slice(0, MOST_LISTED).map((holiday) => {
            const { number, area_m2, lon_deg, lat_deg } = holiday.properties;
            return (
              <li key={number}>
                <Button
                  id={`holiday-${number}`}
                  kind="link-button"
                  title={say("swath.showIt", { it: place([lon_deg, lat_deg], coordinateFormat.value) })}
                  onClick={() => {
                    destination.value = aboutHoliday(holiday);
                  }}
                >
                  <span>{say("swath.holiday", { number })}</span> <span>{area(area_m2)}</span>
                </Button>
              </li>
            );
          })}
        </ol>
      ) : null}
      {found.length > MOST_LISTED ? (
        <p class="small">{say("swath.andSmallerOnes", { found: count(found.length - MOST_LISTED) })}</p>
      ) : null}
    </article>
  );
}
