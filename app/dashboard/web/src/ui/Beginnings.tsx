import { useSignal } from "@preact/signals";
import type { NewMission } from "../api/types";
import { kept } from "../kept";
import { type Draft, faultsOf, toMission } from "../state/draft";
import { draftIn, fileNameOf, missionFile, type Template, withTemplate } from "../state/missionFile";
import { Button, Choice, FileButton, Trouble } from "./Controls";
import { saveText } from "./saving";

/** Templates that were kept on this device. */
const templates = kept<readonly Template[]>("templates", []);

/** What comes with the page: changes of a draft. */
const BUILT_IN: Readonly<Record<string, Partial<Draft>>> = {
  "Single beams or DVL, adaptive": { kind: "survey", planner: "cao", sensor: "dvl" },
  "Multibeam, full coverage": { kind: "survey", planner: "swath", sensor: "multibeam" },
};

/** What a new mission begins with: a template, or a file. */
export function Beginnings({ draft, onBegin }: { draft: Draft; onBegin: (draft: Draft) => void }) {
  const fault = useSignal("");
  const read = (name: string, text: string) => {
    try {
      fault.value = "";
      onBegin(draftIn(name, text));
    } catch (error) {
      fault.value = error instanceof Error ? error.message : String(error);
    }
  };
  const choose = (name: string) => {
    const own = templates.value.find((one) => one.name === name);
    if (own) onBegin(withTemplate(own.mission, draft));
    else if (BUILT_IN[name]) onBegin({ ...draft, ...BUILT_IN[name] });
  };
  const names = [...Object.keys(BUILT_IN), ...templates.value.map(({ name }) => name)];
  return (
    <div class="beginnings">
      <Choice
        value=""
        label="Begin with a template"
        options={[["", "Begin with a template…"], ...names.map((name) => [name, name] as const)]}
        id="template"
        onChoose={choose}
      />
      <FileButton accept=".json" id="mission-file" onText={read}>
        Import
      </FileButton>
      <Trouble words={fault.value} />
    </div>
  );
}

/** Keeps what is described: as a file, or as a template for missions elsewhere. */
export function Keeping({ draft }: { draft: Draft }) {
  const whole = Object.keys(faultsOf(draft)).length === 0;
  const why = whole ? "" : "Only a description without faults can be kept";
  const described = (): NewMission => toMission(draft);
  const mine = templates.value.find(({ name }) => name === draft.name.trim());
  return (
    <div class="keeping">
      <Button
        id="export-draft"
        disabled={!whole}
        title={why}
        onClick={() => saveText(fileNameOf(draft.name), missionFile(described(), draft.tide_table))}
      >
        Export
      </Button>
      <Button
        id="keep-template"
        disabled={!whole}
        title={why || "Keeps all but the places on this device, under the mission's name"}
        onClick={() => {
          const others = templates.value.filter((one) => one !== mine);
          templates.value = [...others, { name: draft.name.trim(), mission: described() }];
        }}
      >
        {mine ? "Renew the template" : "Keep as template"}
      </Button>
      {mine ? (
        <Button
          id="forget-template"
          onClick={() => {
            templates.value = templates.value.filter((one) => one !== mine);
          }}
        >
          Forget the template
        </Button>
      ) : null}
    </div>
  );
}
