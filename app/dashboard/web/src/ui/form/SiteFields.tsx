import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api, NEWEST_TWO, ServiceError } from "../../api/client";
import type { ChangesView, SiteView, SurveyView } from "../../api/types";
import { areaOf } from "../../state/form/draft";
import { said } from "../../state/session";
import { shownSite, sitesOpen } from "../../state/store";
import { say } from "../../words/say";
import { Button, Choice, Hint } from "../parts/Controls";
import { SiteChanges, SiteSurveys } from "../sites/SiteSurveys";
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
    api.changes(site, NEWEST_TWO).then((found) => {
      changes.value = found;
    }, failed);
  }, [site]);
  const known = surveys.value?.filter((survey) => survey.surveyed) ?? [];
  return (
    <>
      {surveys.value && known.length === 0 ? <p class="hint">{say("site.noSurveyOfItHasEnded")}</p> : null}
      <SiteSurveys surveys={known} />
      {known.length > 0 ? <p class="hint">{say("site.theMissionBeginsWithThese")}</p> : null}
      {changes.value ? <SiteChanges found={changes.value} /> : null}
      <Button
        kind="link-button"
        id="show-site-found"
        onClick={() => {
          shownSite.value = site;
          sitesOpen.value = true;
        }}
      >
        {say("site.mapChangesAndFiles")}
      </Button>
      <Hint text={note.value} />
    </>
  );
}
