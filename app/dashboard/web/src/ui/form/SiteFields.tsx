import "./SiteFields.css";
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api, ServiceError } from "../../api/client";
import type { ChangesView, SiteView, SurveyView } from "../../api/types";
import { areaOf } from "../../state/form/draft";
import { day, fixed } from "../../state/format";
import { said } from "../../state/session";
import { say, sayWith } from "../../words/say";
import { Button, Choice, Hint } from "../parts/Controls";
import { Fault, useForm } from "./Fields";

/** Which site a survey belongs to, and what is known of it: its surveys, and what changed between the last two. */
export function SiteFields() {
  const { draft, set } = useForm();
  const sites = useSignal<readonly SiteView[]>([]);
  const note = useSignal("");
  useEffect(() => {
    api.sites().then(
      (list) => {
        sites.value = list;
      },
      (error: unknown) => {
        note.value = said(error);
      },
    );
  }, []);
  const describe = async () => {
    const area = areaOf(draft);
    if (!area || !draft.name.trim()) {
      note.value = say("site.giveTheMissionANameAnd");
      return;
    }
    try {
      const made = await api.createSite({ name: draft.name.trim(), area, cell_m: Number(draft.cell_m) });
      sites.value = [made, ...sites.value];
      note.value = "";
      set({ site: made.id });
    } catch (error) {
      note.value = said(error);
    }
  };
  const options = [
    ["", say("site.none")] as const,
    ...sites.value.map(({ id, name }) => [id, name] as const),
  ];
  return (
    <details class="site" open={draft.site !== ""}>
      <summary>{say("site.siteThatIsSurveyedAgain")}</summary>
      <div class="pair">
        <label class="field">
          {say("search.site")}
          <Choice
            id="site"
            value={draft.site}
            options={options}
            onChoose={(site: string) => set({ site })}
            label={say("search.site")}
          />
        </label>
        <Button kind="link-button" id="make-site" onClick={() => void describe()}>
          {say("site.makeASiteOfThisArea")}
        </Button>
      </div>
      <Hint text={note.value} />
      <Fault field="site" />
      {draft.site ? <Known key={draft.site} site={draft.site} /> : null}
    </details>
  );
}

/** The surveys of a site, and what changed between the last two. */
function Known({ site }: { site: string }) {
  const surveys = useSignal<readonly SurveyView[] | null>(null);
  const changes = useSignal<ChangesView | null>(null);
  const note = useSignal("");
  useEffect(() => {
    const failed = (error: unknown) => {
      // One survey has nothing to be compared with.
      if (!(error instanceof ServiceError && error.status === 404)) note.value = said(error);
    };
    api.surveys(site).then((list) => {
      surveys.value = list;
    }, failed);
    api.changes(site).then((found) => {
      changes.value = found;
    }, failed);
  }, [site]);
  const download = async (name: string) => {
    try {
      const file = await api.siteFile(site, name);
      const link = document.createElement("a");
      link.href = URL.createObjectURL(file.content);
      link.download = file.name;
      link.click();
      URL.revokeObjectURL(link.href);
    } catch (error) {
      note.value = said(error);
    }
  };
  const known = surveys.value?.filter((survey) => survey.surveyed) ?? [];
  return (
    <>
      {surveys.value && known.length === 0 ? <p class="hint">{say("site.noSurveyOfItHasEnded")}</p> : null}
      <ul class="surveys" data-testid="surveys">
        {known.map((survey) => (
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
      {known.length > 0 ? <p class="hint">{say("site.theMissionBeginsWithThese")}</p> : null}
      {changes.value ? <Changes found={changes.value} /> : null}
      {known.length > 0 ? (
        <div class="row">
          <Button kind="link-button" onClick={() => void download("map.tif")}>
            {say("site.mapAsGeotiff")}
          </Button>
          {changes.value ? (
            <Button kind="link-button" id="changes-file" onClick={() => void download("changes.tif")}>
              {say("site.changesAsGeotiff")}
            </Button>
          ) : null}
        </div>
      ) : null}
      <Hint text={note.value} />
    </>
  );
}

/** What changed between the last two surveys, in words. */
function Changes({ found }: { found: ChangesView }) {
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
