import "./Site.css";
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import type { SiteView, SurveyView } from "../../api/types";
import { day, fixed } from "../../state/format";
import { said } from "../../state/session";
import { sitesOpen } from "../../state/store";
import { say } from "../../words/say";
import { Button, Choice, sets, Trouble } from "../parts/Controls";
import { save } from "../parts/download";
import { Changed } from "./Changed";
import { Picture } from "./Picture";
import { SiteForm } from "./SiteForm";

/** Files of a site's map; those in metres can be had in UTM as well. */
const MAP_FILES = ["tif", "bag", "xyz", "geojson", "kml", "dxf", "png"] as const;
const IN_METRES: readonly string[] = ["tif", "xyz", "dxf"];

/** What is known of one site. */
export function Site({ site, onChange }: { site: SiteView; onChange: () => void }) {
  const surveys = useSignal<readonly SurveyView[] | null>(null);
  const trouble = useSignal("");
  useEffect(() => {
    api.surveys(site.id).then(
      (list) => {
        surveys.value = list;
      },
      (error: unknown) => {
        trouble.value = said(error);
      },
    );
  }, [site]);
  const known = surveys.value?.filter(({ surveyed }) => surveyed) ?? [];
  const counting = known.filter(({ left_out }) => !left_out);
  return (
    <div class="site-view" data-testid="site-view">
      <SiteForm site={site} onChange={onChange} />
      <Trouble words={trouble.value} />
      {surveys.value && known.length === 0 ? <p class="empty">{say("site.noSurveyOfItHasEnded")}</p> : null}
      {known.length > 0 ? <Surveys surveys={known} /> : null}
      {counting.length > 0 ? <SiteMap site={site} /> : null}
      {known.length > 1 ? <Changed key={site.updated_at} site={site.id} surveys={known} /> : null}
    </div>
  );
}

/** The surveys whose depths the site has, oldest first. */
function Surveys({ surveys }: { surveys: readonly SurveyView[] }) {
  const number = (value: number | null, digits: number) => (value === null ? "–" : fixed(value, digits));
  const titles = {
    mission: say("fleet.mission"),
    day: say("site.day"),
    share: say("site.sharePct"),
    depths: say("site.depthsM"),
    deviation: say("site.deviationM"),
    changed: say("site.changedPct"),
    below: say("site.below"),
  };
  return (
    <section aria-label={say("site.surveys")}>
      <h3>{say("site.surveys")}</h3>
      {/* biome-ignore lint/a11y/noNoninteractiveTabindex: a table wider than the window is scrolled with the keyboard */}
      <div class="site-table stacked" tabIndex={0}>
        <table data-testid="site-surveys">
          <thead>
            <tr>
              {Object.values(titles).map((title) => (
                <th key={title} scope="col">
                  {title}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {surveys.map((survey) => (
              <tr key={survey.mission_id}>
                <th scope="row">
                  {survey.state === null ? (
                    survey.name
                  ) : (
                    <a
                      href={`#/missions/${encodeURIComponent(survey.mission_id)}`}
                      onClick={sets(sitesOpen, false)}
                    >
                      {survey.name}
                    </a>
                  )}
                  {survey.left_out ? (
                    <small>{say("site.leftOut", { leftOut: survey.left_out })}</small>
                  ) : null}
                </th>
                <td data-title={titles.day}>{survey.ended_at ? day(new Date(survey.ended_at)) : "–"}</td>
                <td data-title={titles.share}>{fixed(survey.share_pct, 0)}</td>
                <td data-title={titles.depths}>
                  {number(survey.min_depth_m, 1)}–{number(survey.max_depth_m, 1)}
                </td>
                <td data-title={titles.deviation}>{number(survey.median_sd_m, 2)}</td>
                <td data-title={titles.changed} title={say("site.aboutFiveIsChance")}>
                  {number(survey.changed_pct, 1)}
                </td>
                <td data-title={titles.below}>{survey.vertical_datum}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

/** The map from all surveys, and its files. */
function SiteMap({ site }: { site: SiteView }) {
  const trouble = useSignal("");
  const crs = useSignal("");
  const making = useSignal("");
  const download = async (format: string) => {
    making.value = format;
    trouble.value = "";
    try {
      const file = await api.siteMapFile(site.id, format, IN_METRES.includes(format) ? crs.value : "");
      save(file.name, file.content);
    } catch (error) {
      trouble.value = said(error);
    } finally {
      making.value = "";
    }
  };
  return (
    <section aria-label={say("site.map")}>
      <h3>{say("site.map")}</h3>
      <Picture
        of={`${site.id} ${site.updated_at} ${site.last_survey_at}`}
        words={say("site.depthsOfAllItsSurveys")}
        id="site-map"
        fetch={() => api.siteMapFile(site.id, "png")}
      />
      <div class="filters">
        {MAP_FILES.map((format) => (
          <Button
            key={format}
            id={`site-file-${format}`}
            busy={making.value === format}
            onClick={() => void download(format)}
          >
            {`map.${format}`}
          </Button>
        ))}
        <label class="field">
          {say("files.grid")}
          <Choice
            id="site-crs"
            value={crs.value}
            options={[
              ["", say("site.ownGrid")],
              ["utm", "UTM"],
            ]}
            title={say("site.inWhichGrid", { formats: IN_METRES.join(", ") })}
            onChoose={(chosen) => {
              crs.value = chosen;
            }}
          />
        </label>
      </div>
      <Trouble words={trouble.value} />
    </section>
  );
}
