import { age, metres, percent } from "../state/format";
import { localizationWords } from "../state/localization";
import {
  abortDialogOpen,
  abortOne,
  mission,
  socketStatus,
  unstopped,
  type Vehicle,
  vehicles,
} from "../state/store";
import { hasEnded, vehicleState, WAYPOINT_WORDS } from "../state/words";
import { WaypointShape } from "./marks";
import { SearchCard } from "./SearchCard";
import { TargetCards } from "./TargetCards";

export function VehicleCards() {
  const present = mission.value;
  if (!present) return null;
  return (
    <section class={`cards${socketStatus.value?.kind === "open" ? "" : " stale"}`} aria-label="Vehicles">
      <SearchCard />
      {vehicles.value.length === 0 ? (
        <p class="empty">
          No vehicle takes part yet. Switch one on within reach of this network, or create a mission with
          simulated vehicles. If a vehicle is on but missing here, run <code>bathyfleet doctor</code>.
        </p>
      ) : (
        vehicles.value.map((vehicle) => <Card key={vehicle.view.name} vehicle={vehicle} />)
      )}
      <TargetCards />
    </section>
  );
}

const LOW_BATTERY_PCT = 25;

function Card({ vehicle }: { vehicle: Vehicle }) {
  const v = vehicle.view;
  const state = vehicleState(v, vehicle.waypoint);
  const away = v.kind === "sim" && v.link === "unknown";
  const ended = mission.value !== null && hasEnded(mission.value.state);
  const low = v.battery_pct !== null && v.battery_pct < LOW_BATTERY_PCT;
  return (
    <article
      class={`card ${state.tone}${vehicle.stale && !away ? " stale" : ""}`}
      style={{ "--vehicle": vehicle.colour }}
      data-testid={`card-${v.name}`}
      data-link={v.link}
      aria-label={`Vehicle ${v.name}`}
    >
      <header>
        <h2>{v.name}</h2>
        <span class={`tone ${state.tone}`} data-testid={`state-${v.name}`}>
          <span aria-hidden="true">{{ calm: "◌", good: "●", warning: "▲", alarm: "✕" }[state.tone]}</span>{" "}
          {state.words}
        </span>
      </header>
      <dl class="big">
        <div>
          <dt>Depth</dt>
          <dd data-testid={`depth-${v.name}`}>{metres(v.depth_m)}</dd>
        </div>
        <div>
          <dt>Altitude</dt>
          <dd>{metres(v.altitude_m)}</dd>
        </div>
        <div class={low ? "low" : ""}>
          <dt>Battery</dt>
          <dd>
            {low ? "▲ " : ""}
            {percent(v.battery_pct)}
          </dd>
        </div>
        <div class={vehicle.stale && !away ? "late" : ""}>
          <dt>Heard</dt>
          <dd>{age(vehicle.age_s)}</dd>
        </div>
      </dl>
      <p class="small">
        {[
          v.kind === "imc"
            ? `IMC${v.imc_id === null ? "" : ` 0x${v.imc_id.toString(16).padStart(4, "0")}`}`
            : v.kind,
          v.address,
          v.speed_mps === null ? null : `${v.speed_mps.toFixed(1)} m/s`,
          ...localizationWords(v),
          v.pursuing === null ? null : `goes for ${v.pursuing}`,
        ]
          .filter((part) => part !== null)
          .map((part) => part?.replaceAll(" ", "\u00a0"))
          .join(" · ")}
      </p>
      {vehicle.waypoint ? (
        <p class="small waypoint-line">
          <WaypointShape status={vehicle.waypoint.status} colour={vehicle.colour} />
          Waypoint {vehicle.waypoint.step} at {metres(vehicle.waypoint.depth_m)} depth,{" "}
          {WAYPOINT_WORDS[vehicle.waypoint.status]}
        </p>
      ) : null}
      {v.active && mission.value && (!ended || unstopped.value.has(v.name)) ? (
        <button
          type="button"
          class="abort-one"
          data-testid={`abort-${v.name}`}
          onClick={() => {
            abortOne.value = v.name;
            abortDialogOpen.value = true;
          }}
        >
          {ended ? `Stop ${v.name} again` : `Abort ${v.name}`}
        </button>
      ) : null}
      {v.reason ? <p class={`reason ${state.tone}`}>{v.reason}</p> : null}
      {vehicle.waypoint?.reason ? <p class={`reason ${state.tone}`}>{vehicle.waypoint.reason}</p> : null}
    </article>
  );
}
