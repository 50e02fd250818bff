import "./FleetDialog.css";
import type { VehicleView } from "../../api/types";
import { age, metres, place, speed } from "../../state/format";
import { ageSeconds } from "../../state/live";
import { batteryWords, vehicleState, whenLastHeard } from "../../state/stateNames";
import { coordinateFormat, fleet, fleetOpen, listedAt, listsLive, missions, now } from "../../state/store";
import { say } from "../../words/say";
import { sets } from "../parts/Controls";
import { Dialog } from "../parts/Dialog";

/** Every vehicle that the service knows of, in a mission or not, one a line. */
export function FleetDialog() {
  const open = fleetOpen.value;
  const close = sets(fleetOpen, false);
  return (
    <Dialog open={open} onClose={close} name="fleet" heading={say("fleet.fleet")} kind="fleet">
      {fleet.value.length === 0 ? (
        <p class="empty">{say("fleet.noVehicleWasHeardYetSwitch")}</p>
      ) : (
        // biome-ignore lint/a11y/noNoninteractiveTabindex: a table wider than the window is scrolled with the keyboard
        <div class="fleet-scroll" tabIndex={0}>
          <table>
            <thead>
              <tr>
                {[
                  say("asked.vehicle"),
                  say("compare.state"),
                  say("fleet.mission"),
                  say("fleet.positionAge"),
                  say("charts.battery"),
                  say("fleet.depth"),
                  say("charts.altitude"),
                  say("fleet.speed"),
                  say("fleet.place"),
                  say("fleet.link"),
                ].map((title) => (
                  <th key={title} scope="col">
                    {title}
                  </th>
                ))}
              </tr>
            </thead>
            <tbody>
              {fleet.value.map((vehicle) => (
                <Line key={`${vehicle.kind} ${vehicle.name}`} vehicle={vehicle} />
              ))}
            </tbody>
          </table>
        </div>
      )}
    </Dialog>
  );
}

function Line({ vehicle: v }: { vehicle: VehicleView }) {
  const told = vehicleState(v, undefined);
  const state = listsLive.value ? told : whenLastHeard(told);
  const name = missions.value?.find((m) => m.id === v.mission_id)?.name;
  const link = [v.kind, v.imc_id === null ? null : `0x${v.imc_id.toString(16).padStart(4, "0")}`, v.address];
  return (
    <tr data-testid={`fleet-${v.name}`}>
      <th scope="row">{v.name}</th>
      <td>
        <span class={`tone ${state.tone}`}>{state.words}</span>
        {v.reason ? <small>{v.reason}</small> : null}
      </td>
      <td>
        {v.mission_id === null ? (
          say("fleet.free")
        ) : (
          <a href={`#/missions/${v.mission_id}`}>{name ?? say("fleet.shownBelow")}</a>
        )}
      </td>
      <td>{age(v.lat_deg === null ? null : ageSeconds(v, listedAt.value, now.value))}</td>
      <td>{batteryWords(v)}</td>
      <td>{metres(v.depth_m)}</td>
      <td>{metres(v.altitude_m)}</td>
      <td>{v.speed_mps === null ? "–" : speed(v.speed_mps)}</td>
      <td>
        {v.lon_deg === null || v.lat_deg === null
          ? "–"
          : place([v.lon_deg, v.lat_deg], coordinateFormat.value)}
      </td>
      <td>{link.filter((part) => part !== null).join(" · ")}</td>
    </tr>
  );
}
