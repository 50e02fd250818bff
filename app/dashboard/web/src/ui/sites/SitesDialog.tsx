import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import type { SiteView } from "../../api/types";
import { said } from "../../state/session";
import { shownSite, sitesOpen } from "../../state/store";
import { say, sayWith } from "../../words/say";
import { Choice, into, sets } from "../parts/Controls";
import { Dialog } from "../parts/Dialog";
import { Site } from "./Site";

/** The places that are surveyed again and again: what is known of each, what changed there, and their files. */
export function SitesDialog() {
  const open = sitesOpen.value;
  const sites = useSignal<readonly SiteView[] | null>(null);
  const trouble = useSignal("");
  const ask = async () => {
    try {
      sites.value = await api.sites();
      trouble.value = "";
    } catch (error) {
      trouble.value = said(error);
    }
  };
  useEffect(() => {
    if (open) void ask();
  }, [open]);
  const list = sites.value ?? [];
  const shown = list.find(({ id }) => id === shownSite.value) ?? list[0];
  return (
    <Dialog
      open={open}
      onClose={sets(sitesOpen, false)}
      name="sites"
      heading={say("site.sites")}
      fault={trouble.value}
      kind="sites"
    >
      {sites.value && !shown ? (
        <p class="empty">{sayWith("site.noSiteYet", { b: <b>{say("site.siteThatIsSurveyedAgain")}</b> })}</p>
      ) : null}
      {list.length > 1 && shown ? (
        <label class="field">
          {say("search.site")}
          <Choice
            id="shown-site"
            value={shown.id}
            options={list.map(({ id, name }) => [id, name] as const)}
            onChoose={into(shownSite)}
          />
        </label>
      ) : null}
      {list.length === 1 && shown ? (
        <p data-testid="only-site">
          <b>{shown.name}</b>
        </p>
      ) : null}
      {open && shown ? <Site key={shown.id} site={shown} onChange={() => void ask()} /> : null}
    </Dialog>
  );
}
