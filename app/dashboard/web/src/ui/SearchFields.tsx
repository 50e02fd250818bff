import { useSignal } from "@preact/signals";
import { areasIn } from "../map/area";
import { Button, FileButton } from "./Controls";
import { Fault, Part, PlaceField, useForm } from "./Fields";

/** What a search looks for, where its vehicles enter, how long they have, and what is known to stand there. */
export function SearchFields() {
  const { draft, set } = useForm();
  const note = useSignal("");
  const read = (name: string, text: string) => {
    try {
      const { area, keepOut, others } = areasIn(name, text);
      const obstacles = [area, ...keepOut, ...others];
      set({ obstacles: [...draft.obstacles, ...obstacles] });
      note.value = `${name}: ${obstacles.length} obstacle${obstacles.length === 1 ? "" : "s"}`;
    } catch (error) {
      note.value = error instanceof Error ? error.message : String(error);
    }
  };
  return (
    <fieldset>
      <legend>Search</legend>
      <PlaceField field="goal" label="Goal" />
      <PlaceField field="entry" label="Entry and exit" />
      <div class="pair">
        <Part of="search" />
        <Part of="quality" />
      </div>
      <FileButton accept=".geojson,.json,.kml" id="obstacles-file" onText={read}>
        Known obstacles from a file
      </FileButton>
      {draft.obstacles.length > 0 ? (
        <span class="zone">
          {draft.obstacles.length} known
          <Button
            kind="tool small"
            aria-label="Forget the known obstacles"
            onClick={() => set({ obstacles: [] })}
          >
            ✕
          </Button>
        </span>
      ) : null}
      {note.value ? (
        <p class="hint" role="status">
          {note.value}
        </p>
      ) : null}
      <Fault field="obstacles" />
    </fieldset>
  );
}
