import "./FleetDialog.css";
import { useSignal, useSignalEffect } from "@preact/signals";
import { api } from "../../api/client";
import type { LngLat, OwnShipView, VehicleView } from "../../api/types";
import { ownPosition } from "../../state/device/geolocation";
import { age, metres, place, speed } from "../../state/format";
import { ageSeconds } from "../../state/live";
import { ownPlace, wayTo } from "../../state/ownPlace";
import { batteryWords, vehicleState, whenLastHeard } from "../../state/stateNames";
import { coordinateFormat, fleet, fleetOpen, listedAt, listsLive, missions, now } from "../../state/store";
import { say } from "../../words/say";
import { sets } from "../parts/Controls";
import { Dialog } from "../parts/Dialog";

/** Every vehicle that the service knows of, in a mission or not, one a line. */
export function FleetDialog() {
  const open = fleetOpen.value;
  const close = sets(fleetOpen, false);
  const from = useFrom();
  return (
    <Dialog open={open} onClose={close} name="fleet" heading={say("fleet.fleet")} kind="fleet">
      {fleet.value.length === 0 ? (
        <p class="empty">{say("fleet.noVehicleWasHeardYetSwitch")}</p>
      ) : (
        // biome-ignore lint/a11y/noNoninteractiveTabindex: a table wider than the window is scrolled with the keyboard
        <div class="fleet-scroll stacked" tabIndex={0}>
          <table>
            <thead>
              <tr>
                {[say("asked.vehicle"), ...Object.values(titles(from !== null))].map((title) => (
                  <th key={title} scope="col">
                    {title}
                  </th>
                ))}
              </tr>
            </thead>
            <tbody>
              {fleet.value.map((vehicle) => (
                <Line key={`${vehicle.kind} ${vehicle.name}`} vehicle={vehicle} from={from} />
              ))}
            </tbody>
          </table>
        </div>
      )}
    </Dialog>
  );
}

/** What is told of each vehicle, beside its name. */
const titles = (isWayKnown: boolean) => ({
  state: say("compare.state"),
  mission: say("fleet.mission"),
  position: say("fleet.positionAge"),
  battery: say("charts.battery"),
  depth: say("cards.vehicleDepth"),
  altitude: say("charts.altitude"),
  speed: say("fleet.speed"),
  place: say("fleet.place"),
  ...(isWayKnown ? { way: say("cards.fromHere") } : {}),
  link: say("fleet.link"),
});

/** From where the way to each vehicle is told: the own ship as it was told with the lists, else this device; null: not known. */
function useFrom(): LngLat | null {
  const ship = useSignal<OwnShipView | null>(null);
  useSignalEffect(() => {
    // Asked anew with every answer about the fleet, without which the own ship is not known either.
    if (!fleetOpen.value || listedAt.value === 0) return;
    api.traffic().then(
      ({ own_ship }) => {
        ship.value = own_ship;
      },
      () => {
        ship.value = null;
      },
    );
  });
  return ownPlace(ship.value, listsLive.value, ownPosition.value);
}

function Line({ vehicle: v, from }: { vehicle: VehicleView; from: LngLat | null }) {
  const told = vehicleState(v, undefined);
  const state = listsLive.value ? told : whenLastHeard(told);
  const name = missions.value?.find((m) => m.id === v.mission_id)?.name;
  const link = [v.kind, v.imc_id === null ? null : `0x${v.imc_id.toString(16).padStart(4, "0")}`, v.address];
  const title = titles(from !== null);
  return (
    <tr data-testid={`fleet-${v.name}`}>
      <th scope="row">{v.name}</th>
      <td data-title={title.state}>
        <span class={`tone ${state.tone}`}>{state.words}</span>
        {v.reason ? <small>{v.reason}</small> : null}
      </td>
      <td data-title={title.mission}>
        {v.mission_id === null ? (
          say("fleet.free")
        ) : (
          <a href={`#/missions/${v.mission_id}`}>{name ?? say("fleet.shownBelow")}</a>
        )}
      </td>
      <td data-title={title.position}>
        {age(v.lat_deg === null ? null : ageSeconds(v, listedAt.value, now.value))}
      </td>
      <td data-title={title.battery}>{batteryWords(v)}</td>
      <td data-title={title.depth}>{metres(v.depth_m)}</td>
      <td data-title={title.altitude}>{metres(v.altitude_m)}</td>
      <td data-title={title.speed}>{v.speed_mps === null ? "–" : speed(v.speed_mps)}</td>
      <td data-title={title.place}>
        {v.lon_deg === null || v.lat_deg === null
          ? "–"
          : place([v.lon_deg, v.lat_deg], coordinateFormat.value)}
      </td>
      {from ? (
        <td data-title={title.way} title={say("cards.distanceAndTrueBearing")}>
          {wayTo(v, from) ?? "–"}
        </td>
      ) : null}
      <td data-title={title.link}>{link.filter((part) => part !== null).join(" · ")}</td>
    </tr>
  );
}
