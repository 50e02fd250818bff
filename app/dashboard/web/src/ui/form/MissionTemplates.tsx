import { useSignal } from "@preact/signals";
import { kept } from "../../persistentSignal";
import { flownBlocks } from "../../state/form/blocks";
import { type Draft, faultsOf, toMission, turnedInto, withSensor } from "../../state/form/draft";
import { draftIn, fileNameOf, missionFile, type Template, withTemplate } from "../../state/form/missionFile";
import { withPlanner } from "../../state/form/plannerOptions";
import { type Key, say } from "../../words/say";
import { Button, Choice, FileButton, same, Trouble } from "../parts/Controls";
import { saveText } from "../parts/download";
import { useForm } from "./Fields";

/** Templates that were kept on this device. */
const templates = kept<readonly Template[]>("templates", []);

/** What comes with the page: surveys by a planner with a sensor. */
const BUILT_IN: Readonly<Partial<Record<Key, Pick<Draft, "planner" | "sensor">>>> = {
  "beginnings.singleBeamsOrDvlAdaptive": { planner: "cao", sensor: "dvl" },
  "beginnings.multibeamFullCoverage": { planner: "swath", sensor: "multibeam" },
};

/** What a new mission begins with: a template, or a file. */
export function MissionTemplates({ draft, onBegin }: { draft: Draft; onBegin: (draft: Draft) => void }) {
  const { planners } = useForm();
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
    const builtIn = BUILT_IN[name as Key];
    if (own) onBegin(withTemplate(own, draft));
    else if (builtIn) {
      onBegin({
        ...draft,
        ...turnedInto("survey", draft),
        ...withPlanner(builtIn.planner, draft, planners),
        ...withSensor(builtIn.sensor, draft),
      });
    }
  };
  const builtIn = (Object.keys(BUILT_IN) as Key[]).map(
    (key) => [key, say(key as "beginnings.multibeamFullCoverage")] as const,
  );
  return (
    <div class="beginnings">
      <Choice
        value=""
        label={say("beginnings.beginWithATemplate")}
        options={[
          ["", say("beginnings.beginWithATemplate2")],
          ...builtIn,
          ...same(templates.value.map(({ name }) => name)),
        ]}
        id="template"
        onChoose={choose}
      />
      <FileButton accept=".json" id="mission-file" onText={read}>
        {say("beginnings.import")}
      </FileButton>
      <Trouble words={fault.value} />
    </div>
  );
}

/** Keeps what is described: as a file, or as a template for missions elsewhere. */
export function Keeping({ draft }: { draft: Draft }) {
  const whole = Object.keys(faultsOf(draft)).length === 0;
  const why = whole ? "" : say("beginnings.onlyADescriptionWithout");
  const mine = templates.value.find(({ name }) => name === draft.name.trim());
  return (
    <div class="keeping">
      <Button
        id="export-draft"
        disabled={!whole}
        title={why}
        onClick={() =>
          saveText(
            fileNameOf(draft.name),
            missionFile(toMission(draft), draft.tide_table, flownBlocks(draft), draft.spacing_m.trim()),
          )
        }
      >
        {say("beginnings.export")}
      </Button>
      <Button
        id="keep-template"
        disabled={!whole}
        title={why || say("beginnings.keepsAllButThePlacesOn")}
        onClick={() => {
          const others = templates.value.filter((one) => one !== mine);
          const spacing_m = draft.spacing_m.trim();
          templates.value = [...others, { name: draft.name.trim(), mission: toMission(draft), spacing_m }];
        }}
      >
        {mine ? say("beginnings.renewTheTemplate") : say("beginnings.keepAsTemplate")}
      </Button>
      {mine ? (
        <Button
          id="forget-template"
          onClick={() => {
            templates.value = templates.value.filter((one) => one !== mine);
          }}
        >
          {say("beginnings.forgetTheTemplate")}
        </Button>
      ) : null}
    </div>
  );
}
