import "./Readout.css";
import { type CellReading, readCell } from "../map/seafloor";
import { metres, place } from "../state/format";
import { coordinateFormat, cursor, seaFloor, shownCertainty } from "../state/store";

/** What lies under the cursor. */
export function Readout() {
  const at = cursor.value;
  if (!at) return null;
  const cell = seaFloor.value ? readCell(seaFloor.value, at) : null;
  return (
    <output class="readout" data-testid="readout">
      <span>{place(at, coordinateFormat.value)}</span>
      {cell ? (
        <span>
          E {cell.east_m.toFixed(1)} m, N {cell.north_m.toFixed(1)} m
        </span>
      ) : null}
      {cell && cell.depth_m !== null && isUnknown(cell) ? (
        <span>not known: a guess would be ±{metres(cell.sd_m, 1)}</span>
      ) : cell && cell.depth_m !== null ? (
        <span>
          <b>{metres(cell.depth_m, 2)}</b> ± {metres(cell.sd_m, 2)} · {origin(cell)}
        </span>
      ) : cell ? (
        <span>not mapped yet</span>
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
  if (cell.sounded) return `${cell.count} sounding${cell.count === 1 ? "" : "s"}`;
  return cell.imported ? "imported" : "guessed";
}
