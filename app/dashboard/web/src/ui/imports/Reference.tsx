import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import type { QualityView, ReferenceView } from "../../api/types";
import { whyNotCommand } from "../../state/access";
import { count, dayAndTime, fixed } from "../../state/format";
import { said } from "../../state/session";
import { mission, selectedId, view } from "../../state/store";
import { sendFile } from "../../state/uploads";
import { say } from "../../words/say";
import { AskedTwice, FilesButton, Trouble } from "../parts/Controls";
import { DepthOptionFields, optionsOf } from "./DepthOptions";
import { Sendings } from "./Sendings";
import { useDepthOptions } from "./useDepthOptions";

/** The grid that the map is compared with: how far off the map is, setting one, taking it away. */
export function Reference() {
  const found = useSignal<ReferenceView | null>(null);
  const difference = useSignal<QualityView["difference"] | null>(null);
  const fault = useSignal("");
  const asked = useSignal(false);
  // As the mission says, until something is changed here.
  const isThere = useSignal(mission.peek()?.has_reference ?? false);
  const options = useDepthOptions();
  const id = selectedId.value;
  const version = view.value.mapVersion;

  /** Change something first, if anything, then look; `known`: what it answered. */
  const look = async (change?: (id: string) => Promise<unknown>, known?: ReferenceView) => {
    if (!id) return;
    try {
      await change?.(id);
      // What is not there is not asked for.
      const reference = known ?? (change || !isThere.peek() ? null : await api.reference(id));
      // There is no map to compare, or one.
      const quality = reference ? await api.quality(id).catch(() => null) : null;
      isThere.value = reference !== null;
      found.value = reference;
      difference.value = quality?.difference ?? null;
      fault.value = "";
    } catch (error) {
      fault.value = said(error);
    }
  };
  useEffect(() => void look(), [id, version]);

  const send = ([file]: File[]) => {
    if (!id || !file) return;
    const wanted = optionsOf(options);
    asked.value = false;
    void sendFile(id, "reference", file, (sending) => api.sendReference(id, wanted, sending)).then(
      (answer) => (answer ? look(undefined, answer) : undefined),
    );
  };
  const reference = found.value;
  return (
    <section aria-label={say("imports.reference")}>
      <h3>{say("imports.reference")}</h3>
      <p class="hint">{say("imports.whatReferencesAre")}</p>
      {whyNotCommand.value ? null : (
        <>
          <DepthOptionFields options={options} weighed={false} id="reference" />
          <p class="row">
            <FilesButton id="reference-file" onFiles={send}>
              {say("imports.sendGrid")}
            </FilesButton>
            {reference ? (
              <AskedTwice
                asked={asked}
                first={{
                  id: "reference-delete",
                  commands: true,
                  onClick: () => {
                    asked.value = true;
                  },
                  children: say("imports.removeReference"),
                }}
                last={{
                  id: "reference-delete-really",
                  commands: true,
                  onClick: () => {
                    asked.value = false;
                    void look(api.deleteReference);
                  },
                  children: say("imports.removeReally"),
                }}
                keep={{ children: say("imports.keep") }}
              />
            ) : null}
          </p>
        </>
      )}
      <Trouble words={fault.value} />
      <Sendings purpose="reference" />
      {reference ? (
        <div data-testid="reference">
          <b>{reference.filename}</b>, {dayAndTime(new Date(reference.created_at))}
          {reference.source ? `, ${reference.source}` : ""}
          <p>{say("imports.referenceCells", { count: reference.cells, cells: count(reference.cells) })}</p>
          {difference.value ? (
            <p data-testid="reference-difference">
              {say("files.differenceToTheReferenceGrid", {
                rmseM: fixed(difference.value.rmse_m, 2),
                biasM: fixed(difference.value.bias_m, 2),
                p95M: fixed(difference.value.p95_m, 2),
              })}{" "}
              {say("imports.seeTheLayer")}
            </p>
          ) : null}
          <ul class="small">
            {reference.notes.map((note) => (
              <li key={note}>{note}</li>
            ))}
          </ul>
        </div>
      ) : (
        <p class="empty">{say("imports.noReference")}</p>
      )}
    </section>
  );
}
