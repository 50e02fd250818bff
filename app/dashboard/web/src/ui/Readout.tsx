import { readCell } from "../map/geo";
import { latitude, longitude, metres } from "../state/format";
import { cursor, seaFloor } from "../state/store";

/** What lies under the cursor. */
export function Readout() {
  const place = cursor.value;
  if (!place) return null;
  const cell = seaFloor.value ? readCell(seaFloor.value, place) : null;
  return (
    <output class="readout" data-testid="readout">
      <span>
        {latitude(place[1])} {longitude(place[0])}
      </span>
      {cell ? (
        <span>
          E {cell.east_m.toFixed(1)} m, N {cell.north_m.toFixed(1)} m
        </span>
      ) : null}
      {cell && cell.depth_m !== null ? (
        <span>
          <b>{metres(cell.depth_m, 2)}</b> ± {metres(cell.sd_m, 2)} ·{" "}
          {cell.sounded ? `${cell.count} sounding${cell.count === 1 ? "" : "s"}` : "interpolated"}
        </span>
      ) : cell ? (
        <span>not mapped yet</span>
      ) : null}
    </output>
  );
}
