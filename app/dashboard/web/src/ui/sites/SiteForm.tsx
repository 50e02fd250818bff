import { useSignal } from "@preact/signals";
import { api } from "../../api/client";
import type { SiteView } from "../../api/types";
import { whyNotCommand } from "../../state/access";
import { plain, pointed } from "../../state/format";
import { said } from "../../state/session";
import { say } from "../../words/say";
import { AskedTwice, Button, sets, Trouble, Typed } from "../parts/Controls";

const FORM = "site-form";

/** What a site is called, how fine its grid is, how fast its floor changes; and deletes one that holds nothing. */
export function SiteForm({ site, onChange }: { site: SiteView; onChange: () => void }) {
  const name = useSignal(site.name);
  const cell = useSignal(plain(site.cell_m));
  const yearly = useSignal(plain(site.yearly_change_m));
  const trouble = useSignal("");
  const busy = useSignal(false);
  const asked = useSignal(false);
  const empty = site.missions + site.surveys === 0;
  const forbidden = whyNotCommand.value;
  const doing = async (work: () => Promise<unknown>) => {
    if (busy.value) return;
    busy.value = true;
    trouble.value = "";
    try {
      await work();
      onChange();
    } catch (error) {
      trouble.value = said(error);
    } finally {
      busy.value = false;
    }
  };
  const change = (event: Event) => {
    event.preventDefault();
    const number = (text: string) => (text.trim() === "" ? Number.NaN : Number(pointed(text.trim())));
    const cell_m = number(cell.value);
    const yearly_change_m = number(yearly.value);
    if (Number.isNaN(cell_m) || Number.isNaN(yearly_change_m)) {
      trouble.value = say("corrections.typeNumbers");
      return;
    }
    void doing(() => api.changeSite(site.id, { name: name.value.trim(), cell_m, yearly_change_m }));
  };
  return (
    <details>
      <summary>{say("site.changeThisSite")}</summary>
      <form id={FORM} class="filters site-form" onSubmit={change}>
        <label class="field">
          {say("mission.name")}
          <Typed text={name} id="site-name" maxLength={200} />
        </label>
        <label class="field">
          {say("site.cellM")}
          <Typed text={cell} id="site-cell" />
        </label>
        <label class="field">
          {say("site.yearlyChangeM")}
          <Typed text={yearly} id="site-yearly" />
        </label>
        <Button id="change-site" commands busy={busy.value} form={FORM}>
          {say("site.apply")}
        </Button>
        <AskedTwice
          asked={asked}
          first={{
            id: "delete-site",
            disabled: forbidden !== "" || !empty,
            title: forbidden || (empty ? "" : say("site.holdsMissions")),
            onClick: sets(asked, true),
            children: say("missions.delete"),
          }}
          last={{
            id: "confirm-delete-site",
            onClick: () => void doing(() => api.deleteSite(site.id)),
            children: say("missions.deleteItForGood"),
          }}
          keep={{ id: "keep-site", children: say("missions.keepIt") }}
        />
      </form>
      <p class="hint">{say("site.yearlyChangeMeans")}</p>
      <Trouble words={trouble.value} />
    </details>
  );
}
