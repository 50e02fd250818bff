import "./AreaFields.css";
import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { DrawingView, LngLat } from "../../api/types";
import { areasIn, sizeOf } from "../../map/area";
import { AREA_FILES, areaText, isAreaFile } from "../../map/areaText";
import { whyNotCommand } from "../../state/access";
import { withAreas } from "../../state/form/blocks";
import { centred, cornersOf } from "../../state/form/draft";
import { asTyped, withRings } from "../../state/form/places";
import { distance, fixed } from "../../state/format";
import {
  type Drawing,
  drawing,
  drawingReady,
  editedMission,
  editing,
  editingReady,
  mapCentre,
} from "../../state/store";
import { say } from "../../words/say";
import { Button, FilesButton } from "../parts/Controls";
import { ChartZones } from "./ChartZones";
import { DrawingQuestions } from "./DrawingQuestions";
import { Fault, Text, useForm } from "./Fields";
import { useDrawingFile } from "./useDrawingFile";

/** Those that the page does not read itself. */
const DRAWING_FILES = ".dxf,.zip";

/** The areas that the service found in a file, as GeoJSON. */
const featuresOf = ({ areas }: DrawingView) => ({
  type: "FeatureCollection",
  features: areas.map(({ name, area }) => ({ type: "Feature", properties: { name }, geometry: area })),
});

/** Where to map: drawn on the map, typed as a rectangle, or read from a file; and where not to go. */
export function AreaFields() {
  const { draft, faults, set } = useForm();
  const note = useSignal("");
  const others = useSignal<readonly (readonly LngLat[])[]>([]);
  const corners = cornersOf(draft);
  const size = corners.length > 2 ? sizeOf(corners) : null;
  // Of what is being edited, as it was and as it became: while a corner is dragged effects come late.
  const edited = useRef(new WeakSet<readonly LngLat[]>());
  const busy = drawing.value !== null;
  useEffect(() => {
    if (draft.source !== "drawn" || draft.ring.length < 3 || busy) {
      edited.current = new WeakSet();
      editing.value = null;
    } else if (!edited.current.has(draft.ring)) {
      const rings = new WeakSet([draft.ring]);
      edited.current = rings;
      editing.value = {
        ring: draft.ring,
        onChanged: (ring) => {
          rings.add(ring);
          set({ ring });
        },
      };
    }
  }, [draft.source, draft.ring, busy]);
  useEffect(
    () => () => {
      editing.value = null;
    },
    [],
  );
  /** Another click on what is being drawn ends that. */
  const begin = (what: string, shape: Drawing["shape"], onDrawn: (ring: LngLat[]) => void) => {
    drawing.value = drawing.value?.what === what ? null : { what, shape, onDrawn };
  };
  const take = (ring: LngLat[]) => {
    note.value = "";
    others.value = [];
    set({ source: "drawn", ring });
  };
  const takeText = (name: string, text: string) => {
    try {
      const found = areasIn(name, text);
      set(({ keepOut }) => {
        const zones = withRings(keepOut, found.keepOut);
        const stay = zones.length - found.keepOut.length;
        note.value = found.note + (stay > 0 ? say("area.zonesStay", { stay }) : "");
        return { source: "drawn", ring: found.area, keepOut: zones };
      });
      others.value = found.others;
    } catch (error) {
      note.value = error instanceof Error ? error.message : String(error);
    }
  };
  // Drawings and shapefiles are read by the service.
  const drawn = useDrawingFile((found, name) => takeText(name, JSON.stringify(featuresOf(found))));
  const read = async ([file]: File[]) => {
    if (!file) return;
    note.value = "";
    if (!isAreaFile(file.name) && !whyNotCommand.peek()) return drawn.read(file);
    try {
      takeText(file.name, await areaText(file));
    } catch (error) {
      note.value = error instanceof Error ? error.message : String(error);
    }
  };
  return (
    <fieldset>
      <legend>{say("area.area")}</legend>
      <div class="draw-buttons">
        <Button
          id="draw-polygon"
          aria-pressed={drawing.value?.what === "corners"}
          onClick={() => begin("corners", "polygon", take)}
        >
          {say("area.drawCorners")}
        </Button>
        <Button
          id="draw-rectangle"
          aria-pressed={drawing.value?.what === "rectangle"}
          onClick={() => begin("rectangle", "rectangle", take)}
        >
          {say("area.drawRectangle")}
        </Button>
        <FilesButton
          accept={whyNotCommand.value ? AREA_FILES : `${AREA_FILES},${DRAWING_FILES}`}
          id="area-file"
          busy={drawn.busy}
          onFiles={(files) => void read(files)}
        >
          {say(drawn.busy ? "lines.beingRead" : "area.fromAFile")}
        </FilesButton>
      </div>
      <DrawingQuestions of={drawn} id="area" />
      {drawing.value ? (
        <p class="hint" role="status" data-testid="drawing" data-ready={drawingReady.value}>
          {drawing.value.shape === "polygon"
            ? say("area.clickCornerAfterCornerOnThe")
            : say("area.clickOneCornerOnTheMap")}
        </p>
      ) : null}
      {editing.value ? (
        <p class="hint" role="status" data-testid="editing" data-ready={editingReady.value}>
          {say("area.dragACornerOnTheMap")}
        </p>
      ) : null}
      {note.value ? (
        <p class="hint" role="status" data-testid="area-note">
          {note.value}
        </p>
      ) : null}
      {others.value.length > 0 ? (
        <div class="other-areas">
          {others.value.map((ring, i) => (
            <Button
              id={`other-area-${i + 1}`}
              key={ring.join()}
              onClick={() => {
                others.value = others.value.map((one) => (one === ring ? draft.ring : one));
                set({ source: "drawn", ring });
              }}
            >
              {say("area.takeTheOneOfHa", { areaM2: fixed(sizeOf(ring).area_m2 / 1e4, 2) })}
            </Button>
          ))}
          {draft.kind === "survey" && !editedMission.peek() ? (
            <Button
              id="areas-as-blocks"
              onClick={() => {
                set(withAreas(draft, others.value));
                others.value = [];
              }}
            >
              {say("blocks.takeThemAll", { all: others.value.length + 1 })}
            </Button>
          ) : null}
        </div>
      ) : null}
      {draft.source === "typed" ? (
        <>
          <div class="pair">
            <Text field="latitude" label={say("area.southWestCornerN")} numeric />
            <Text field="longitude" label={say("area.southWestCornerE")} numeric />
            <Text field="east_m" label={say("area.toTheEastM")} numeric />
            <Text field="north_m" label={say("area.toTheNorthM")} numeric />
          </div>
          <Button kind="link-button" onClick={() => set(centred(draft, mapCentre.value))}>
            {say("area.placeItInTheMiddleOf")}
          </Button>
        </>
      ) : (
        <Button kind="link-button" onClick={() => set(asTyped)}>
          {say("area.typeARectangleInstead")}
        </Button>
      )}
      {size && !faults.ring ? (
        <p class="hint" data-testid="area-size">
          {say("area.xHa", {
            eastM: distance(size.east_m),
            northM: distance(size.north_m),
            areaM2: fixed(size.area_m2 / 1e4, 2),
            it: draft.source === "drawn" ? say("area.corners", { corners: corners.length }) : "",
          })}
        </p>
      ) : null}
      <Fault field="ring" />
      <div class="zones">
        <Button
          id="draw-keep-out"
          kind="link-button"
          aria-pressed={drawing.value?.what === "zone"}
          onClick={() =>
            begin("zone", "polygon", (ring) =>
              set(({ keepOut }) => ({ keepOut: withRings(keepOut, [ring]) })),
            )
          }
        >
          {say("area.keepOutZone")}
        </Button>
        {draft.keepOut.map((zone, i) => (
          <span key={zone.join()} class="zone">
            {say("area.zone", { i: i + 1 })}
            <Button
              kind="tool small"
              aria-label={say("area.removeKeepOutZone", { i: i + 1 })}
              onClick={() => set(({ keepOut }) => ({ keepOut: keepOut.filter((one) => one !== zone) }))}
            >
              ✕
            </Button>
          </span>
        ))}
      </div>
      <ChartZones />
      <Fault field="keepOut" />
    </fieldset>
  );
}
