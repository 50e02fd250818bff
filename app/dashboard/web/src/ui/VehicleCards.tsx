import "./VehicleCards.css";
import type { VehicleView } from "../api/types";
import { age, clock, distance, metres, percent } from "../state/format";
import { localizationWords } from "../state/localization";
import { replayed } from "../state/replay";
import { bringHome, holdVehicle, rejoin, resumeVehicle, returnVehicle } from "../state/session";
import {
  abortDialogOpen,
  abortOne,
  mission,
  now,
  replayStep,
  socketStatus,
  unstopped,
  type Vehicle,
  vehicles,
} from "../state/store";
import {
  batteryWords,
  capital,
  failsafeTone,
  failsafeWords,
  hasEnded,
  isSaid,
  isThere,
  PHASE_WORDS,
  rangeWords,
  sonarWords,
  type Tone,
  vehicleState,
  WAYPOINT_WORDS,
} from "../state/words";
import { Button, flips } from "./Controls";
import { CrosslinesCard } from "./CrosslinesCard";
import { Grip } from "./Grip";
import { WaypointShape } from "./marks";
import { cardsFolded, cardsWidth, shownFolded } from "./room";
import { SearchCard } from "./SearchCard";
import { SwathCard } from "./SwathCard";
import { TargetCards } from "./TargetCards";
import { LineOrders, OrderLine } from "./VehicleOrders";

export function VehicleCards() {
  const present = mission.value;
  if (!present) return null;
  return (
    <div class="cards-column">
      <section
        class={`cards${socketStatus.value?.kind === "open" ? "" : " stale"}`}
        aria-label="Vehicles"
        // biome-ignore lint/a11y/noNoninteractiveTabindex: cards higher than the window are scrolled with the keyboard
        tabIndex={0}
      >
        <div class="cards-head">
          <Button
            id="fold-cards"
            kind="fold"
            aria-pressed={shownFolded.value}
            title={shownFolded.value ? "Show whole cards" : "Show only what one has to know of each vehicle"}
            onClick={flips(cardsFolded)}
          >
            {shownFolded.value ? "◂ Whole cards" : "Fold cards ▸"}
          </Button>
        </div>
        <SearchCard />
        <SwathCard />
        {vehicles.value.length === 0 ? (
          <p class="empty">
            No vehicle takes part yet. Switch one on within reach of this network, or create a mission with
            simulated vehicles. If a vehicle is on but missing here, run <code>bathyfleet doctor</code>.
          </p>
        ) : (
          vehicles.value.map((vehicle) => <Card key={vehicle.view.name} vehicle={vehicle} />)
        )}
        <TargetCards />
        <CrosslinesCard />
      </section>
      {shownFolded.value ? null : (
        <Grip what="the cards" size={cardsWidth} side="left" least={250} most={520} id="grip-cards" />
      )}
    </div>
  );
}

function Card({ vehicle }: { vehicle: Vehicle }) {
  const then = replayed.value?.find((one) => one.vehicle === vehicle.view.name);
  if (replayStep.value !== null) return <PastCard vehicle={vehicle} depth_m={then?.depth_m ?? null} />;
  const v = vehicle.view;
  const state = vehicleState(v, vehicle.waypoint);
  const away = v.kind === "sim" && v.link === "unknown";
  const ended = mission.value !== null && hasEnded(mission.value);
  const byEndurance = v.battery_pct === null && v.energy_left_pct !== null;
  return (
    <article
      class={`card ${state.tone}${v.active ? "" : " left"}${vehicle.stale && !away ? " stale" : ""}`}
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
        <div class={v.battery ?? ""}>
          <dt>{byEndurance ? "Energy" : "Battery"}</dt>
          <dd data-testid={`energy-${v.name}`}>
            {byEndurance ? percent(v.energy_left_pct) : batteryWords(v)}
          </dd>
        </div>
        <div class={vehicle.stale && !away ? "late" : ""}>
          <dt>Heard</dt>
          <dd>{age(vehicle.age_s)}</dd>
        </div>
      </dl>
      {v.active && !ended ? <Range of={v} /> : null}
      <Reasons vehicle={vehicle} tone={state.tone} />
      <p class="small">
        {[
          v.kind === "imc"
            ? `IMC${v.imc_id === null ? "" : ` 0x${v.imc_id.toString(16).padStart(4, "0")}`}`
            : v.kind,
          v.address,
          v.speed_mps === null ? null : `${v.speed_mps.toFixed(1)} m/s`,
          ...sonarWords(v, mission.value?.spec.vehicles),
          ...localizationWords(v),
          v.pursuing === null ? null : `goes for ${v.pursuing}`,
        ]
          .filter((part) => part !== null)
          .map((part) => part?.replaceAll(" ", "\u00a0"))
          .join(" · ")}
      </p>
      {v.phase !== null && mission.value && mission.value.progress.elapsed_s > 0 ? (
        <p class="small" data-testid={`flown-${v.name}`}>
          {[
            ...(v.active && !ended ? [capital(PHASE_WORDS[v.phase])] : []),
            `${distance(v.flown_m)} flown`,
            `${Math.round(v.idle_s)} s idle`,
          ].join(" · ")}
        </p>
      ) : null}
      {vehicle.waypoint && v.active ? (
        <p class="small waypoint-line">
          <WaypointShape status={vehicle.waypoint.status} colour={vehicle.colour} />
          Waypoint {vehicle.waypoint.step} at {metres(vehicle.waypoint.depth_m)} depth,{" "}
          {WAYPOINT_WORDS[vehicle.waypoint.status]}
        </p>
      ) : null}
      <OrderLine of={v} />
      {v.active ? <Orders of={v} ended={ended} /> : null}
      {v.active ? null : (
        <p class="small left-at" data-testid={`left-${v.name}`}>
          Left{v.left_at ? ` at ${clock(new Date(v.left_at), "utc")} UTC` : ""}; it is shown where it was
          last.
        </p>
      )}
      {!v.active && !ended ? (
        <div class="orders">
          <Button
            id={`rejoin-${v.name}`}
            kind="command again"
            commands
            title="Let it take part again, as it was described"
            onClick={() => void rejoin(v.name)}
          >
            Add again
          </Button>
          {mission.value?.state === "running" && v.recovery_point !== null ? (
            <Button
              id={`bring-home-${v.name}`}
              kind="command again"
              commands
              title="Take it back and send it to its recovery point"
              onClick={() => void bringHome(v.name)}
            >
              Bring home
            </Button>
          ) : null}
        </div>
      ) : null}
    </article>
  );
}

/** What is wrong with a vehicle, and why it does what it does. */
function Reasons({ vehicle: { view: v, waypoint }, tone }: { vehicle: Vehicle; tone: Tone }) {
  const present = mission.value;
  const over = present !== null && (present.ending !== null || hasEnded(present));
  const plain = v.phase === "returning" || v.phase === "home";
  return (
    <>
      {v.active && v.failsafes.length > 0 ? (
        <ul class="failsafes">
          {v.failsafes.map((one) => (
            <li
              key={one.failsafe}
              class={`reason ${failsafeTone(one, v)}`}
              data-testid={`failsafe-${one.failsafe}-${v.name}`}
            >
              <b>
                <span aria-hidden="true">{failsafeTone(one, v) === "warning" ? "▲" : "✕"}</span>{" "}
                {failsafeWords(one)}
              </b>{" "}
              {one.message}
            </li>
          ))}
        </ul>
      ) : null}
      {v.withdrawn && v.active && !(over && plain) && !isSaid(v.withdrawn, v) ? (
        <p class="reason" data-testid={`withdrawn-${v.name}`}>
          Surveys no more: {v.withdrawn}
        </p>
      ) : null}
      {v.reason && !isSaid(v.reason, v) ? <p class={`reason ${tone}`}>{v.reason}</p> : null}
      {waypoint?.reason ? <p class={`reason ${tone}`}>{waypoint.reason}</p> : null}
    </>
  );
}

/** How long its energy lasts beside what its way home takes; nothing where neither is known. */
function Range({ of: v }: { of: VehicleView }) {
  const words = rangeWords(v, now.value);
  if (words.length === 0) return null;
  const { energy_left_pct: left_pct, energy_left_s: left_s, return_needs_s: needs_s } = v;
  const needs_pct = left_pct && left_s && needs_s !== null ? (left_pct * needs_s) / left_s : null;
  return (
    <div class="range-left" data-testid={`range-${v.name}`}>
      {left_pct === null ? null : (
        <div
          class="energy-bar"
          role="img"
          aria-label={`Energy of ${v.name}: ${percent(left_pct)}`}
          title={needs_pct === null ? "" : "The mark is what its way home needs"}
        >
          <i style={{ width: `${left_pct}%` }} />
          {needs_pct === null ? null : <b style={{ left: `${Math.min(needs_pct, 100)}%` }} />}
        </div>
      )}
      <p class="small">{words.map((part) => part.replaceAll(" ", "\u00a0")).join(" · ")}</p>
    </div>
  );
}

/** What can be asked of a vehicle that takes part. */
function Orders({ of: v, ended }: { of: VehicleView; ended: boolean }) {
  const present = mission.value;
  const again = ended && unstopped.value.has(v.name);
  if (!present || (ended && !again)) return null;
  const led = present.state === "running" && present.ending === null;
  return (
    <div class="orders">
      {led && v.recovery_point !== null && v.withdrawn === "" ? (
        <Button
          id={`return-${v.name}`}
          commands
          title="Send it home to its recovery point; the others go on"
          onClick={() => void returnVehicle(v.name)}
        >
          Bring home
        </Button>
      ) : null}
      {led && v.withdrawn === "" ? (
        <Button
          id={`hold-${v.name}`}
          commands
          title="Let it wait where it is until it is resumed; the others go on"
          onClick={() => void holdVehicle(v.name)}
        >
          Hold
        </Button>
      ) : null}
      <LineOrders of={v} />
      {led && isThere(v) ? (
        <Button
          id={`resume-${v.name}`}
          commands
          title="Let it survey again, for example with a new battery"
          onClick={() => void resumeVehicle(v.name)}
        >
          Resume survey
        </Button>
      ) : null}
      <Button
        id={`abort-${v.name}`}
        kind="abort-one"
        commands
        onClick={() => {
          abortOne.value = v.name;
          abortDialogOpen.value = true;
        }}
      >
        {ended ? `Stop ${v.name} again` : `Abort ${v.name}`}
      </Button>
    </div>
  );
}

/** A vehicle as it was at the step that is replayed: what was not kept of it is not shown. */
function PastCard({ vehicle, depth_m }: { vehicle: Vehicle; depth_m: number | null }) {
  const { name } = vehicle.view;
  const waypoint = replayed.value?.find((one) => one.vehicle === name)?.waypoint;
  return (
    <article
      class="card calm past"
      style={{ "--vehicle": vehicle.colour }}
      data-testid={`card-${name}`}
      aria-label={`Vehicle ${name} at step ${replayStep.value}`}
    >
      <header>
        <h2>{name}</h2>
        <span class="tone calm">At step {replayStep.value}</span>
      </header>
      <dl class="big">
        <div>
          <dt>Depth</dt>
          <dd data-testid={`depth-${name}`}>{metres(depth_m)}</dd>
        </div>
      </dl>
      {waypoint ? (
        <p class="small waypoint-line">
          <WaypointShape status={waypoint.status} colour={vehicle.colour} />
          Waypoint {waypoint.step} at {metres(waypoint.depth_m)} depth, {WAYPOINT_WORDS[waypoint.status]}
        </p>
      ) : null}
    </article>
  );
}
