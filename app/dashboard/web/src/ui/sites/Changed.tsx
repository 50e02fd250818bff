import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api, type Compared, NEWEST_TWO } from "../../api/client";
import type { ChangesView, SurveyView } from "../../api/types";
import { PALETTES } from "../../map/picture/palette";
import { day, fixed } from "../../state/format";
import { said } from "../../state/session";
import { say } from "../../words/say";
import { Button, Choice, Trouble } from "../parts/Controls";
import { save } from "../parts/download";
import { Picture } from "./Picture";
import { SiteChanges } from "./SiteSurveys";

const FORMATS = ["tif", "csv", "png"] as const;

/** What changed between two surveys of a site: figures, a picture, files. */
export function Changed({ site, surveys }: { site: string; surveys: readonly SurveyView[] }) {
  const compared = useSignal<Compared>(NEWEST_TWO);
  const found = useSignal<ChangesView | null>(null);
  const trouble = useSignal("");
  useEffect(() => {
    let gone = false;
    api.changes(site, compared.value).then(
      (view) => {
        if (gone) return;
        found.value = view;
        trouble.value = "";
      },
      (error: unknown) => {
        if (gone) return;
        found.value = null;
        trouble.value = said(error);
      },
    );
    return () => {
      gone = true;
    };
  }, [site, compared.value]);
  const { earlier, later } = found.value ?? {};
  const from = compared.value.from || earlier?.mission_id || "";
  const to = compared.value.to || later?.mission_id || "";
  const named = surveys.map(
    ({ mission_id, name, ended_at }) =>
      [mission_id, ended_at ? `${name}, ${day(new Date(ended_at))}` : name] as const,
  );
  // While none is compared, none is shown as chosen.
  const options = (chosen: string) => (chosen ? named : ([["", "–"], ...named] as const));
  const choose = (part: Partial<Compared>) => {
    compared.value = { from, to, ...part };
  };
  const download = async (format: string) => {
    try {
      const file = await api.changesFile(site, format, compared.value);
      save(file.name, file.content);
    } catch (error) {
      trouble.value = said(error);
    }
  };
  return (
    <section aria-label={say("site.changes")}>
      <h3>{say("site.changes")}</h3>
      <div class="filters">
        <label class="field">
          {say("site.earlier")}
          <Choice
            id="changes-from"
            value={from}
            options={options(from)}
            onChoose={(chosen) => choose({ from: chosen })}
          />
        </label>
        <label class="field">
          {say("site.later")}
          <Choice
            id="changes-to"
            value={to}
            options={options(to)}
            onChoose={(chosen) => choose({ to: chosen })}
          />
        </label>
      </div>
      <Trouble words={trouble.value} />
      {found.value ? <Found site={site} found={found.value} compared={compared.value} /> : null}
      {found.value ? (
        <div class="filters">
          {FORMATS.map((format) => (
            <Button key={format} id={`changes-file-${format}`} onClick={() => void download(format)}>
              {`changes.${format}`}
            </Button>
          ))}
        </div>
      ) : null}
    </section>
  );
}

function Found({ site, found, compared }: { site: string; found: ChangesView; compared: Compared }) {
  const last = found.last_colour_m;
  return (
    <>
      <SiteChanges found={found} />
      <p>
        {say("site.meanDifference", {
          mean: signed(found.mean_m),
          rms: found.rms_m === null ? "–" : fixed(found.rms_m, 2),
          sd: found.median_sd_m === null ? "–" : fixed(found.median_sd_m, 2),
          least: signed(found.least_m),
          largest: signed(found.largest_m),
        })}
      </p>
      {found.notes.map((note) => (
        <p key={note} class="hint">
          {note}
        </p>
      ))}
      <Picture
        of={`${found.earlier.mission_id} ${found.later.mission_id}`}
        words={say("site.differences")}
        id="changes-picture"
        cells
        fetch={() => api.changesFile(site, "png", compared)}
      />
      <div class="changes-scale">
        <span>{say("site.shoaler", { metres: fixed(-last, 2) })}</span>
        <div
          role="img"
          aria-label={say("site.fromShoalerToDeeper", { metres: fixed(last, 2) })}
          style={{ background: `linear-gradient(to right, ${PALETTES.balance.css})` }}
        />
        <span>{say("site.deeper", { metres: fixed(last, 2) })}</span>
      </div>
      <p class="hint">{say("site.paleIsNotSignificant")}</p>
    </>
  );
}

const signed = (value: number | null): string =>
  value === null ? "–" : `${value > 0 ? "+" : ""}${fixed(value, 2)}`;
