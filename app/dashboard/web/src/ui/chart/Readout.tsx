import "./Readout.css";
import { type CellReading, readCell } from "../../map/picture/seafloor";
import { fixed, metres, place } from "../../state/format";
import { coordinateFormat, cursor, seaFloor, shownCertainty } from "../../state/store";
import { say } from "../../words/say";

/** What lies under the cursor. */
export function Readout() {
  const at = cursor.value;
  if (!at) return null;
  const cell = seaFloor.value ? readCell(seaFloor.value, at) : null;
  return (
    <output class="readout" data-testid="readout">
      <span>{place(at, coordinateFormat.value)}</span>
      {cell ? (
        <span>{say("readout.eMNM", { eastM: fixed(cell.east_m, 1), northM: fixed(cell.north_m, 1) })}</span>
      ) : null}
      {cell && cell.depth_m !== null && isUnknown(cell) ? (
        <span>{say("readout.notKnownAGuessWouldBe", { sdM: metres(cell.sd_m, 1) })}</span>
      ) : cell && cell.depth_m !== null ? (
        <span>
          <b>{metres(cell.depth_m, 2)}</b> ± {metres(cell.sd_m, 2)} · {origin(cell)}
        </span>
      ) : cell ? (
        <span>{say("readout.notMappedYet")}</span>
      ) : null}
    </output>
  );
}

/** Whether it is too unsure to be shown on the map. */
function isUnknown({ sd_m, sounded, imported }: CellReading): boolean {
  const certainty = shownCertainty.value;
  return !sounded && !imported && certainty !== null && (sd_m ?? 0) >= certainty.none_m;
}

function origin(cell: { sounded: boolean; imported: boolean; count: number }): string {
  if (cell.sounded) return say("readout.sounding", { count: cell.count });
  return cell.imported ? say("readout.imported") : say("readout.guessed");
}
