/** Vehicles and waypoints as shapes on the map. */

import "./marks.css";
import type { LngLat, VehicleView, WaypointStatus, WaypointView } from "../../api/types";
import { wayBetween } from "../../map/geo";
import { age } from "../../state/format";
import { PHASE_WORDS, WAYPOINT_WORDS } from "../../state/stateNames";
import type { Vehicle } from "../../state/store";
import { say } from "../../words/say";

/** A vehicle as it was: its heading is that of its last way. */
interface Past {
  name: string;
  colour: string;
  from: LngLat | null;
  at: LngLat;
}

export function VehicleMark({ vehicle, past }: { vehicle?: Vehicle; past?: Past }) {
  if (past) {
    const heading = past.from ? wayBetween(past.from, past.at).bearing_deg : null;
    return <Mark name={past.name} colour={past.colour} heading_deg={heading} age="" title={past.name} />;
  }
  if (!vehicle) return null;
  const { name, kind, heading_deg, link, active, breach } = vehicle.view;
  // A simulation that is over is nobody who ought to be heard.
  const away = kind === "sim" && link === "unknown";
  const old = !away && (vehicle.stale || link === "lost" || link === "unknown");
  return (
    <Mark
      name={name}
      stage={stageOf(vehicle.view)}
      colour={vehicle.colour}
      heading_deg={heading_deg}
      stale={vehicle.stale || !active}
      left={!active}
      alarm={breach}
      age={old ? age(vehicle.age_s) : ""}
      title={`${name}${vehicle.stale && !away ? say("marks.positionOld", { ageS: age(vehicle.age_s) }) : ""}`}
    />
  );
}

/** What a vehicle's shape on the map tells of it. */
export const STAGES = ["surveying", "returning", "home"] as const;
type Stage = (typeof STAGES)[number];

const stageOf = ({ active, withdrawn, phase }: VehicleView): Stage =>
  active && withdrawn !== "" && (phase === "returning" || phase === "home") ? phase : "surveying";

interface ShapeProps {
  stage: Stage;
  colour: string;
  heading_deg: number | null;
  size?: number;
}

/** Full while it surveys, hollow on its way home, a house there. */
export function VehicleShape({ stage, colour, heading_deg, size = 34 }: ShapeProps) {
  const hollow = stage === "returning";
  const paint = hollow ? { class: "hollow", stroke: colour } : { class: "outline", fill: colour };
  return (
    <svg viewBox="-16 -16 32 32" width={size} height={size} aria-hidden="true">
      {stage === "home" ? (
        <path d="M0,-11 L12,0 H8 V10 H-8 V0 H-12 Z" {...paint} />
      ) : heading_deg === null ? (
        <circle r="8" {...paint} />
      ) : (
        <path d="M0,-13 L8.5,10 L0,5.5 L-8.5,10 Z" transform={`rotate(${heading_deg})`} {...paint} />
      )}
    </svg>
  );
}

interface MarkProps {
  name: string;
  stage?: Stage;
  colour: string;
  heading_deg: number | null;
  stale?: boolean;
  /** It takes no part any more. */
  left?: boolean;
  /** Where it is that it must not be. */
  alarm?: string;
  age: string;
  title: string;
}

function Mark({
  name,
  stage = "surveying",
  colour,
  heading_deg,
  stale = false,
  left = false,
  alarm = "",
  age: old,
  title,
}: MarkProps) {
  return (
    <div
      class={`vehicle-mark${stale ? " stale" : ""}${alarm ? " alarm" : ""}`}
      data-testid={`vehicle-mark-${name}`}
      data-stage={stage}
      title={title}
    >
      <VehicleShape stage={stage} colour={colour} heading_deg={heading_deg} />
      <span class="mark-label">
        {name}
        {left ? say("marks.left") : ""}
        {stage === "surveying" ? "" : ` ${PHASE_WORDS[stage]}`}
        {old ? <b> {say("marks.old", { old })}</b> : null}
        {alarm ? <b> ✕ {alarm}</b> : null}
      </span>
    </div>
  );
}

/** Each stage of a waypoint's life has a shape of its own; the colour is the vehicle's. */
export function WaypointShape({ status, colour }: { status: WaypointStatus; colour: string }) {
  return (
    <svg viewBox="-12 -12 24 24" width="24" height="24" aria-hidden="true" class="waypoint-shape">
      {shape(status, colour)}
    </svg>
  );
}

function shape(status: WaypointStatus, colour: string) {
  switch (status) {
    case "planned":
      return <circle r="6" class="halo" stroke={colour} stroke-width="2" stroke-dasharray="2 3" />;
    case "sent":
      return <circle r="6" class="halo" stroke={colour} stroke-width="2.5" />;
    case "acknowledged":
      return (
        <>
          <circle r="7" class="halo" stroke={colour} stroke-width="2.5" />
          <circle r="3" fill={colour} />
        </>
      );
    case "reached":
      return (
        <>
          <circle r="7" fill={colour} class="outline" />
          <path d="M-3.5,0 L-1,3 L4,-3" fill="none" stroke="#10181d" stroke-width="2" />
        </>
      );
    case "refused":
      return (
        <>
          <rect x="-7" y="-7" width="14" height="14" class="halo" stroke={colour} stroke-width="2.5" />
          <path d="M-4,-4 L4,4 M-4,4 L4,-4" stroke="currentColor" stroke-width="2.5" />
        </>
      );
    case "missed":
      return (
        <>
          <circle r="7" class="halo" stroke={colour} stroke-width="2.5" />
          <path d="M-6,6 L6,-6" stroke="currentColor" stroke-width="2.5" />
        </>
      );
  }
}

/** Where a vehicle has to turn back at the latest. */
export function TurnBackMark({ name, colour }: { name: string; colour: string }) {
  const words = say("marks.turnBack", { name });
  return (
    <div
      class="turn-back-mark"
      data-testid={`turn-back-mark-${name}`}
      role="img"
      aria-label={words}
      title={words}
    >
      <span aria-hidden="true" style={{ color: colour }}>
        ↩
      </span>
    </div>
  );
}

export function WaypointMark({ waypoint, colour }: { waypoint: WaypointView; colour: string }) {
  const words = say("marks.waypointOf", {
    step: waypoint.step,
    vehicle: waypoint.vehicle,
    status: WAYPOINT_WORDS[waypoint.status],
  });
  return (
    <div
      class="waypoint-mark"
      data-testid={`waypoint-${waypoint.vehicle}`}
      data-status={waypoint.status}
      title={waypoint.reason ? `${words}. ${waypoint.reason}` : words}
    >
      <WaypointShape status={waypoint.status} colour={colour} />
    </div>
  );
}
