import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { areasIn } from "../map/area";
import { typedPlace } from "../state/draft";
import { picking } from "../state/store";
import { Fault, Part, Text, useForm } from "./Fields";

/** What a search looks for, where its vehicles enter, how long they have, and what is known to stand there. */
export function SearchFields() {
  const { draft, set } = useForm();
  const note = useSignal("");
  useEffect(() => {
    const stop = (event: KeyboardEvent) => {
      if (event.key === "Escape") picking.value = null;
    };
    window.addEventListener("keydown", stop);
    return () => {
      window.removeEventListener("keydown", stop);
      picking.value = null;
    };
  }, []);
  const read = async (file: File | undefined) => {
    if (!file) return;
    try {
      const { area, keepOut, others } = areasIn(file.name, await file.text());
      const obstacles = [area, ...keepOut, ...others];
      set({ obstacles: [...draft.obstacles, ...obstacles] });
      note.value = `${file.name}: ${obstacles.length} obstacle${obstacles.length === 1 ? "" : "s"}`;
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
      <label class="command file">
        Known obstacles from a file
        <input
          type="file"
          accept=".geojson,.json,.kml"
          data-testid="obstacles-file"
          onChange={(event) => {
            void read(event.currentTarget.files?.[0]);
            event.currentTarget.value = "";
          }}
        />
      </label>
      {draft.obstacles.length > 0 ? (
        <span class="zone">
          {draft.obstacles.length} known
          <button
            type="button"
            class="tool small"
            aria-label="Forget the known obstacles"
            onClick={() => set({ obstacles: [] })}
          >
            ✕
          </button>
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
      <button
        type="button"
        class="command"
        aria-pressed={waiting}
        data-testid={`pick-${field}`}
        onClick={() => {
          picking.value = waiting
            ? null
            : { what: field, onPicked: (at) => set({ [field]: typedPlace(at) }) };
        }}
      >
        {waiting ? "Click on the map…" : "Pick"}
      </button>
    </div>
  );
}
