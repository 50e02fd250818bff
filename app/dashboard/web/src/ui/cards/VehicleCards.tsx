import "./VehicleCards.css";
import { useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { VehicleView } from "../../api/types";
import { ownPosition } from "../../state/device/geolocation";
import { age, clock, distance, metres, percent, speed } from "../../state/format";
import { localizationWords } from "../../state/localization";
import { typingFor } from "../../state/orders/orders";
import { ownPlace, wayTo } from "../../state/ownPlace";
import { replayed } from "../../state/past/replay";
import { bringHome, holdVehicle, rejoin, resumeVehicle, returnVehicle } from "../../state/session";
import {
  batteryWords,
  capital,
  failsafeTone,
  failsafeWords,
  hasEnded,
  hasStarted,
  isSaid,
  isThere,
  PHASE_WORDS,
  rangeWords,
  sonarWords,
  type Tone,
  vehicleState,
  WAYPOINT_WORDS,
  whenLastHeard,
} from "../../state/stateNames";
import {
  abortDialogOpen,
  abortOne,
  live,
  mission,
  ownShip,
  replayStep,
  serviceNow,
  unstopped,
  type Vehicle,
  vehicles,
} from "../../state/store";
import { waterDepth_m } from "../../state/water";
import { say, sayWith } from "../../words/say";
import { cardsFolded, cardsWidth, shownFolded } from "../chart/layout";
import { Button, flips } from "../parts/Controls";
import { Grip } from "../parts/Grip";
import { WaypointShape } from "../parts/marks";
import { Steady } from "../parts/Steady";
import { CrosslinesCard } from "./CrosslinesCard";
import { SearchCard } from "./SearchCard";
import { SwathCard } from "./SwathCard";
import { TargetCards } from "./TargetCards";
import { TracksCard } from "./TracksCard";
import { LineOrders, OrderLine, TypedPlace } from "./VehicleOrders";

export function VehicleCards() {
  const present = mission.value;
  if (!present) return null;
  return (
    <aside class="cards-column" aria-label={say("compare.vehicles")}>
      <section
        class={`cards${live.value ? "" : " stale"}`}
        // biome-ignore lint/a11y/noNoninteractiveTabindex: cards higher than the window are scrolled with the keyboard
        tabIndex={0}
      >
        <div class="cards-head">
          <Button
            id="fold-cards"
            kind="fold"
            aria-pressed={shownFolded.value}
            title={shownFolded.value ? say("cards.showWholeCards") : say("cards.showOnlyWhatOneHasTo")}
            onClick={flips(cardsFolded)}
          >
            {shownFolded.value ? say("cards.wholeCards") : say("cards.foldCards")}
          </Button>
        </div>
        <SearchCard />
        <SwathCard />
        {vehicles.value.length === 0 ? (
          <p class="empty">
            {sayWith("cards.noVehicleTakesPartYetSwitch", { code: <code>bathyfleet doctor</code> })}
          </p>
        ) : (
          vehicles.value.map((vehicle) => <Card key={vehicle.view.name} vehicle={vehicle} />)
        )}
        <TargetCards />
        <CrosslinesCard />
        <TracksCard />
      </section>
      {shownFolded.value ? null : (
        <Grip
          what={say("cards.theCards")}
          size={cardsWidth}
          side="left"
          least={250}
          most={520}
          id="grip-cards"
        />
      )}
    </aside>
  );
}

function Card({ vehicle }: { vehicle: Vehicle }) {
  const then = replayed.value?.find((one) => one.vehicle === vehicle.view.name);
  if (replayStep.value !== null) return <PastCard vehicle={vehicle} depth_m={then?.depth_m ?? null} />;
  const v = vehicle.view;
  const told = vehicleState(v, vehicle.waypoint);
  const state = live.value ? told : whenLastHeard(told);
  const sign = live.value ? { calm: "◌", good: "●", warning: "▲", alarm: "✕" }[state.tone] : "?";
  const away = v.kind === "sim" && v.link === "unknown";
  const ended = mission.value !== null && hasEnded(mission.value);
  const started = mission.value !== null && hasStarted(mission.value);
  const byEndurance = v.battery_pct === null && v.energy_left_pct !== null;
  return (
    <article
      class={`card ${state.tone}${v.active ? "" : " left"}${vehicle.stale && !away ? " stale" : ""}`}
      style={{ "--vehicle": vehicle.colour }}
      data-testid={`card-${v.name}`}
      data-link={v.link}
      aria-label={say("cards.vehicle", { v: v.name })}
    >
      <Steady>
        <header>
          <h2>{v.name}</h2>
          <span class={`tone ${state.tone}`} data-testid={`state-${v.name}`}>
            <span aria-hidden="true">{sign}</span> {state.words}
          </span>
        </header>
        <dl class="big">
          <div>
            <dt title={say("cards.vehicleDepth")}>{say("cards.vehicleDepthShort")}</dt>
            <dd data-testid={`depth-${v.name}`}>{metres(v.depth_m)}</dd>
          </div>
          <div>
            <dt>{say("charts.altitude")}</dt>
            <dd data-testid={`altitude-${v.name}`}>{metres(v.altitude_m)}</dd>
          </div>
          <div class={v.battery ?? ""}>
            <dt>{byEndurance ? say("asked.energy") : say("charts.battery")}</dt>
            <dd data-testid={`energy-${v.name}`}>
              {byEndurance ? percent(v.energy_left_pct) : batteryWords(v)}
            </dd>
          </div>
          <div class={vehicle.stale && !away ? "late" : ""} title={say("cards.sinceItToldWhereItIs")}>
            <dt>{say("cards.positionAge")}</dt>
            <dd data-testid={`position-age-${v.name}`}>{age(v.lat_deg === null ? null : vehicle.age_s)}</dd>
          </div>
        </dl>
        <Surroundings of={vehicle} />
      </Steady>
      {v.active ? <Orders of={v} ended={ended} /> : null}
      <Reasons vehicle={vehicle} tone={state.tone} />
      <OrderLine of={v} />
      <Steady key={`${v.active} ${ended}`}>
        {v.active && !ended ? <Range of={v} /> : null}
        <p class="small">
          {[
            v.kind === "imc"
              ? `IMC${v.imc_id === null ? "" : ` 0x${v.imc_id.toString(16).padStart(4, "0")}`}`
              : v.kind,
            v.address,
            v.speed_mps === null ? null : speed(v.speed_mps),
            ...sonarWords(v, mission.value?.spec.vehicles),
            ...localizationWords(v),
            v.pursuing === null ? null : say("cards.goesFor", { pursuing: v.pursuing }),
          ]
            .filter((part) => part !== null)
            .map((part) => part?.replaceAll(" ", "\u00a0"))
            .join(" · ")}
        </p>
        {v.phase !== null && started ? (
          <p class="small" data-testid={`flown-${v.name}`}>
            {[
              ...(v.active && !ended && !v.waiting_circle ? [capital(PHASE_WORDS[v.phase])] : []),
              say("cards.flown", { flownM: distance(v.flown_m) }),
              say("cards.sIdle", { idleS: Math.round(v.idle_s) }),
            ].join(" · ")}
          </p>
        ) : null}
        {v.active && started ? <WaypointLine vehicle={vehicle} /> : null}
      </Steady>
      {v.active ? null : (
        <p class="small left-at" data-testid={`left-${v.name}`}>
          {say("cards.leftItIsShownWhereIt", {
            it: v.left_at ? say("cards.atUtc", { it: clock(new Date(v.left_at), "utc") }) : "",
          })}
        </p>
      )}
      {!v.active && !ended ? (
        <div class="orders">
          <Button
            id={`rejoin-${v.name}`}
            kind="command again"
            commands
            title={say("cards.letItTakePartAgainAs")}
            onClick={() => void rejoin(v.name)}
          >
            {say("cards.addAgain")}
          </Button>
          {mission.value?.state === "running" && v.recovery_point !== null ? (
            <Button
              id={`bring-home-${v.name}`}
              kind="command again"
              commands
              title={say("cards.takeItBackAndSendIt")}
              onClick={() => void bringHome(v.name)}
            >
              {say("cards.bringHome")}
            </Button>
          ) : null}
        </div>
      ) : null}
    </article>
  );
}

/** How deep the water is there, and how far and which way it is to where it was last; neither where it is not known. */
function Surroundings({ of: { view: v, stale } }: { of: Vehicle }) {
  const water_m = waterDepth_m(v, live.value && !stale);
  const way = wayTo(v, ownPlace(ownShip.value, live.value, ownPosition.value));
  if (water_m === null && way === null) return null;
  return (
    <p class="surroundings">
      {water_m === null ? null : (
        <span title={say("cards.vehicleDepthAndAltitude")}>
          {say("cards.water")} <b data-testid={`water-${v.name}`}>{metres(water_m)}</b>
        </span>
      )}
      {way === null ? null : (
        <span title={say("cards.distanceAndTrueBearing")}>
          {say("cards.fromHere")} <b data-testid={`from-here-${v.name}`}>{way}</b>
        </span>
      )}
    </p>
  );
}

/** Where it goes; there as soon as it may be told one, so that nothing moves when it is. */
function WaypointLine({ vehicle: { waypoint, colour } }: { vehicle: Vehicle }) {
  if (!waypoint) return <p class="small">{say("cards.noWaypointYet")}</p>;
  return (
    <p class="small waypoint-line">
      <WaypointShape status={waypoint.status} colour={colour} />
      {say("cards.waypointAtDepth", {
        step: waypoint.step,
        depthM: metres(waypoint.depth_m),
        status: WAYPOINT_WORDS[waypoint.status],
      })}
    </p>
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
          {say("cards.surveysNoMore", { withdrawn: v.withdrawn })}
        </p>
      ) : null}
      {v.reason && !isSaid(v.reason, v) ? <p class={`reason ${tone}`}>{v.reason}</p> : null}
      {waypoint?.reason && waypoint.reason !== v.withdrawn ? (
        <p class={`reason ${tone}`}>{waypoint.reason}</p>
      ) : null}
    </>
  );
}

/** How long its energy lasts beside what its way home takes; nothing where neither is known. */
function Range({ of: v }: { of: VehicleView }) {
  const words = rangeWords(v, serviceNow.value);
  if (words.length === 0) return null;
  const { energy_left_pct: left_pct, energy_left_s: left_s, return_needs_s: needs_s } = v;
  const needs_pct = left_pct && left_s && needs_s !== null ? (left_pct * needs_s) / left_s : null;
  return (
    <div class="range-left" data-testid={`range-${v.name}`}>
      {left_pct === null ? null : (
        <div
          class="energy-bar"
          role="img"
          aria-label={say("cards.energyOf", { v: v.name, leftPct: percent(left_pct) })}
          title={needs_pct === null ? "" : say("cards.theMarkIsWhatItsWay")}
        >
          <i style={{ width: `${left_pct}%` }} />
          {needs_pct === null ? null : <b style={{ left: `${Math.min(needs_pct, 100)}%` }} />}
        </div>
      )}
      <p class="small">{words.map((part) => part.replaceAll(" ", "\u00a0")).join(" · ")}</p>
    </div>
  );
}

/** What can be asked of a vehicle that takes part: one row, on narrow windows what is seldom needed in a menu. */
function Orders({ of: v, ended }: { of: VehicleView; ended: boolean }) {
  const present = mission.value;
  const again = ended && unstopped.value.has(v.name);
  if (!present || (ended && !again)) return null;
  const led = present.state === "running" && present.ending === null;
  const surveys = led && v.withdrawn === "";
  return (
    <div class="orders">
      {surveys && v.recovery_point !== null ? (
        <Button
          id={`return-${v.name}`}
          commands
          title={say("cards.sendItHomeToItsRecovery")}
          onClick={() => void returnVehicle(v.name)}
        >
          {say("cards.bringHome")}
        </Button>
      ) : null}
      {led && isThere(v) ? (
        <Button
          id={`resume-${v.name}`}
          commands
          title={say("cards.letItSurveyAgainForExample")}
          onClick={() => void resumeVehicle(v.name)}
        >
          {say("cards.resumeSurvey")}
        </Button>
      ) : null}
      {surveys ? (
        <More of={v.name}>
          <Button
            id={`hold-${v.name}`}
            commands
            title={say("cards.letItWaitWhereItIs")}
            onClick={() => void holdVehicle(v.name)}
          >
            {say("cards.hold")}
          </Button>
          <LineOrders of={v} />
        </More>
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
        <span class="in-full">
          {ended ? say("cards.stopAgain", { v: v.name }) : say("cards.abort", { v: v.name })}
        </span>
        <span class="in-short" aria-hidden="true">
          {ended ? say("cards.stopAgainShort") : say("cards.abortShort")}
        </span>
      </Button>
      {typingFor.value === v.name ? <TypedPlace name={v.name} /> : null}
    </div>
  );
}

/** From its button to the menu, pixels. */
const GAP_PX = 6;
/** As wide as the menu is at most, pixels. */
const WIDTH_PX = 230;

/** Further orders: beside the others where there is room, in a menu over the card where there is none. */
function More({ of, children }: { of: string; children: ComponentChildren }) {
  const open = useSignal(false);
  const menu = useRef<HTMLDivElement>(null);
  const place = () => {
    const at = menu.current?.previousElementSibling?.getBoundingClientRect(); // its button's
    if (!at) return;
    const left = Math.max(0, Math.min(at.left, window.innerWidth - WIDTH_PX));
    menu.current?.style.setProperty("--left", `${left}px`);
    menu.current?.style.setProperty("--bottom", `${window.innerHeight - at.top + GAP_PX}px`);
  };
  useEffect(() => {
    if (!open.value) return;
    // Its card grows and moves as the vehicle tells more: it would come to lie over the stop.
    let frame = requestAnimationFrame(function follow() {
      place();
      frame = requestAnimationFrame(follow);
    });
    return () => cancelAnimationFrame(frame);
  }, [open.value]);
  useEffect(() => {
    const box = menu.current;
    // What was chosen is on its way.
    const fold = () => {
      if (open.peek()) box?.hidePopover();
    };
    box?.addEventListener("click", fold);
    return () => box?.removeEventListener("click", fold);
  }, []);
  const flip = () => {
    place();
    menu.current?.togglePopover();
  };
  return (
    <>
      <Button
        id={`more-${of}`}
        kind="command more"
        aria-expanded={open.value}
        aria-label={say("cards.furtherOrders", { name: of })}
        onClick={flip}
      >
        {say("cards.more")}
      </Button>
      <div
        ref={menu}
        popover="auto"
        class="more-orders"
        data-testid={`more-orders-${of}`}
        onToggle={(event) => {
          open.value = event.newState === "open";
        }}
      >
        {children}
      </div>
    </>
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
      aria-label={say("cards.vehicleAtStep", { name, replayStep: replayStep.value ?? 0 })}
    >
      <header>
        <h2>{name}</h2>
        <span class="tone calm">{say("cards.atStep", { replayStep: replayStep.value ?? 0 })}</span>
      </header>
      <dl class="big">
        <div>
          <dt title={say("cards.vehicleDepth")}>{say("cards.vehicleDepthShort")}</dt>
          <dd data-testid={`depth-${name}`}>{metres(depth_m)}</dd>
        </div>
      </dl>
      {waypoint ? (
        <p class="small waypoint-line">
          <WaypointShape status={waypoint.status} colour={vehicle.colour} />
          {say("cards.waypointAtDepth", {
            step: waypoint.step,
            depthM: metres(waypoint.depth_m),
            status: WAYPOINT_WORDS[waypoint.status],
          })}
        </p>
      ) : null}
    </article>
  );
}
