import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import type { ImportView } from "../../api/types";
import { whyNotCommand } from "../../state/access";
import { count, dayAndTime, metres } from "../../state/format";
import { said } from "../../state/session";
import { mission, selectedId } from "../../state/store";
import { sendFile } from "../../state/uploads";
import { say } from "../../words/say";
import { AskedTwice, FilesButton, Trouble } from "../parts/Controls";
import { DepthOptionFields, optionsOf } from "./DepthOptions";
import { Sendings } from "./Sendings";
import { useDepthOptions } from "./useDepthOptions";

/** Soundings and maps from elsewhere that a mission begins with: what was taken, sending one, taking one back. */
export function Priors() {
  const imports = useSignal<readonly ImportView[] | null>(null);
  const fault = useSignal("");
  const options = useDepthOptions();
  const id = selectedId.value;
  const state = mission.value?.state;
  const ended = state === "finished" || state === "aborted" || state === "failed";

  /** Change something first, if anything, then look. */
  const look = async (change?: (id: string) => Promise<unknown>) => {
    if (!id) return;
    try {
      await change?.(id);
      imports.value = await api.imports(id);
      fault.value = "";
    } catch (error) {
      fault.value = said(error);
    }
  };
  useEffect(() => void look(), [id]);

  const send = ([file]: File[]) => {
    if (!id || !file) return;
    const asked = optionsOf(options);
    void sendFile(id, "import", file, (sending) => api.sendImport(id, asked, sending)).then(() => look());
  };
  return (
    <section aria-label={say("imports.priors")}>
      <h3>{say("imports.priors")}</h3>
      <p class="hint">{say("imports.whatPriorsAre")}</p>
      {whyNotCommand.value || ended ? null : (
        <>
          <DepthOptionFields options={options} weighed id="prior" />
          <p class="row">
            <FilesButton id="prior-file" onFiles={send}>
              {say("imports.sendFile")}
            </FilesButton>
          </p>
        </>
      )}
      <Trouble words={fault.value} />
      <Sendings purpose="import" />
      <ul data-testid="priors">
        {(imports.value ?? []).map((one) => (
          <li key={one.id}>
            <Prior one={one} onDelete={() => void look((of) => api.deleteImport(of, one.id))} />
          </li>
        ))}
      </ul>
      {imports.value?.length === 0 ? <p class="empty">{say("imports.noPrior")}</p> : null}
    </section>
  );
}

function Prior({ one, onDelete }: { one: ImportView; onDelete: () => void }) {
  const asked = useSignal(false);
  return (
    <>
      <b>{one.filename}</b>, {dayAndTime(new Date(one.created_at))}
      {one.source ? `, ${one.source}` : ""}
      <p>
        {say("imports.taken", {
          taken: count(one.taken),
          found: count(one.found),
          shoalest: metres(one.min_depth_m, 2),
          deepest: metres(one.max_depth_m, 2),
          sd: metres(one.median_sd_m, 2),
        })}
      </p>
      <ul class="small">
        {one.notes.map((note) => (
          <li key={note}>{note}</li>
        ))}
      </ul>
      {whyNotCommand.value ? null : (
        <p class="row">
          <AskedTwice
            asked={asked}
            first={{
              id: "prior-delete",
              commands: true,
              onClick: () => {
                asked.value = true;
              },
              children: say("imports.takeBack"),
            }}
            last={{
              id: "prior-delete-really",
              commands: true,
              onClick: onDelete,
              children: say("imports.takeBackReally"),
            }}
            keep={{ children: say("imports.keep") }}
          />
        </p>
      )}
    </>
  );
}
