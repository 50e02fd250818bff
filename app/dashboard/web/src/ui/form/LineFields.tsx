import { useSignal } from "@preact/signals";
import type { DrawingView, LngLat, PolygonGeometry } from "../../api/types";
import { ringOf, sizeOf } from "../../map/area";
import { whyNotCommand } from "../../state/access";
import { cornersOf } from "../../state/form/draft";
import { lengthOf, liesElsewhere, linesIn, withLines, withoutLines } from "../../state/form/surveyLines";
import { distance, fixed } from "../../state/format";
import { say } from "../../words/say";
import { Button, FilesButton } from "../parts/Controls";
import { DrawingQuestions } from "./DrawingQuestions";
import { Fault, useForm } from "./Fields";
import { PlannerOptionFields } from "./PlannerOptionFields";
import { useDrawingFile } from "./useDrawingFile";

const LINE_FILES = ".geojson,.json,.kml,.kmz,.gpx,.dxf,.zip,.csv,.txt,.lnw";

interface FoundArea {
  words: string;
  ring: LngLat[];
}

/** Lines of a plan that are flown as they are given, from the files of survey programs, drawings and GIS. */
export function LineFields() {
  const { draft, set } = useForm();
  const notes = useSignal<readonly string[]>([]);
  const areas = useSignal<readonly FoundArea[]>([]);
  const take = (found: DrawingView, name: string) => {
    const lines = linesIn(found);
    areas.value = areasOf(found);
    notes.value = lines.length > 0 ? found.notes : [say("lines.noneInFile", { name }), ...found.notes];
    if (lines.length === 0) return;
    const [first] = areas.peek();
    set((present) => ({
      ...withLines(present, lines),
      // Nobody chose an area yet that has anything to do with them.
      ...(first && liesElsewhere(present, cornersOf(present), lines)
        ? { source: "drawn", ring: first.ring }
        : {}),
    }));
  };
  const file = useDrawingFile(take);
  const { lines } = draft;
  return (
    <div class="given-lines" data-testid="given-lines">
      {whyNotCommand.value ? null : (
        <FilesButton
          accept={LINE_FILES}
          id="lines-file"
          busy={file.busy}
          onFiles={([chosen]) => {
            if (chosen) file.read(chosen);
          }}
        >
          {say(file.busy ? "lines.beingRead" : "lines.fromAFile")}
        </FilesButton>
      )}
      <DrawingQuestions of={file} id="lines" />
      {notes.value.map((note) => (
        <p key={note} class="hint" role="status">
          {note}
        </p>
      ))}
      {lines.length > 0 ? (
        <>
          <p class="hint" data-testid="lines-given">
            {say("lines.given", {
              lines: lines.length,
              metres: distance(lines.reduce((sum, line) => sum + lengthOf(line), 0)),
            })}{" "}
            <Button id="lines-remove" kind="link-button" onClick={() => set(withoutLines)}>
              {say("lines.remove")}
            </Button>
          </p>
          {areas.value
            .filter(({ ring }) => ring.join() !== draft.ring.join())
            .map(({ words, ring }, i) => (
              <Button
                id={`lines-area-${i + 1}`}
                key={ring.join()}
                onClick={() => set({ source: "drawn", ring })}
              >
                {words}
              </Button>
            ))}
          <label class="check" title={say("lines.asDrawnHint")}>
            <input
              type="checkbox"
              checked={lines.every((line) => line.keep_direction)}
              data-testid="lines-as-drawn"
              onChange={({ currentTarget: { checked } }) =>
                set({ lines: lines.map((line) => ({ ...line, keep_direction: checked })) })
              }
            />
            {say("lines.asDrawn")}
          </label>
          <PlannerOptionFields names={["keep_line_order"]} />
        </>
      ) : null}
      <Fault field="lines" />
    </div>
  );
}

/** Areas that a file has, and the one around its lines. */
function areasOf({ areas, around }: DrawingView): FoundArea[] {
  const found = areas.map(({ name, area, area_m2 }) => ({
    words: say("lines.takeArea", { name, area: fixed(area_m2 / 1e4, 2) }),
    ring: ringOf(area as PolygonGeometry),
  }));
  if (!around) return found;
  const ring = ringOf(around as PolygonGeometry);
  return [...found, { words: say("lines.areaAround", { area: fixed(sizeOf(ring).area_m2 / 1e4, 2) }), ring }];
}
