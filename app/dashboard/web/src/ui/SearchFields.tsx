import "./SearchFields.css";
import { useSignal } from "@preact/signals";
import { areasIn } from "../map/area";
import { typedPlace } from "../state/draft";
import { picking } from "../state/store";
import { Button, FileButton, useEscape } from "./Controls";
import { Fault, Part, Text, useForm } from "./Fields";

/** What a search looks for, where its vehicles enter, how long they have, and what is known to stand there. */
export function SearchFields() {
  const { draft, set } = useForm();
  const note = useSignal("");
  useEscape(picking);
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
      <Place field="goal" label="Goal" />
      <Place field="entry" label="Entry and exit" />
      <div class="pair">
        <Part of="search" />
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

function Place({ field, label }: { field: "goal" | "entry"; label: string }) {
  const { set } = useForm();
  const waiting = picking.value?.what === field;
  return (
    <div class="picked">
      <Text field={field} label={label} placeholder="latitude, longitude" />
      <Button
        id={`pick-${field}`}
        aria-pressed={waiting}
        onClick={() => {
          picking.value = waiting
            ? null
            : { what: field, onPicked: (at) => set({ [field]: typedPlace(at) }) };
        }}
      >
        {waiting ? "Click on the map…" : "Pick"}
      </Button>
    </div>
  );
}
