import { useSignal } from "@preact/signals";
import { areasIn } from "../../map/area";
import { AREA_FILES, areaText } from "../../map/areaText";
import { withRings } from "../../state/form/places";
import { say } from "../../words/say";
import { Button, FilesButton, Hint } from "../parts/Controls";
import { Fault, Part, PlaceField, useForm } from "./Fields";

/** What a search looks for, where its vehicles enter, how long they have, and what is known to stand there. */
export function SearchFields() {
  const { draft, set } = useForm();
  const note = useSignal("");
  const read = async ([file]: File[]) => {
    if (!file) return;
    try {
      const { area, keepOut, others } = areasIn(file.name, await areaText(file));
      const obstacles = [area, ...keepOut, ...others];
      set((now) => ({ obstacles: withRings(now.obstacles, obstacles) }));
      note.value = say("search.obstacle", { name: file.name, obstacles: obstacles.length });
    } catch (error) {
      note.value = error instanceof Error ? error.message : String(error);
    }
  };
  return (
    <fieldset>
      <legend>{say("mission.search")}</legend>
      <PlaceField field="goal" label={say("mission.goal")} />
      <PlaceField field="entry" label={say("search.entryAndExit")} />
      <div class="pair">
        <Part of="search" />
        <Part of="quality" />
      </div>
      <FilesButton accept={AREA_FILES} id="obstacles-file" onFiles={(files) => void read(files)}>
        {say("search.knownObstaclesFromAFile")}
      </FilesButton>
      {draft.obstacles.length > 0 ? (
        <span class="zone">
          {say("search.known", { obstacles: draft.obstacles.length })}
          <Button
            kind="tool small"
            aria-label={say("search.forgetTheKnownObstacles")}
            onClick={() => set({ obstacles: [] })}
          >
            ✕
          </Button>
        </span>
      ) : null}
      <Hint text={note.value} />
      <Fault field="obstacles" />
    </fieldset>
  );
}
