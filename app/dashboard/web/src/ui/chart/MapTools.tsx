import "./MapTools.css";
import type { Signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { wayBetween } from "../../map/geo";
import { followOwn, ownFault, whyNoPosition } from "../../state/device/geolocation";
import { direction, distance } from "../../state/format";
import {
  coordinateFormat,
  crossovers,
  goingTo,
  in3d,
  measured,
  mission,
  seaFloor,
  ships,
  showCrossings,
  showHolidays,
  showRanges,
  showShips,
  showSite,
  showTargets,
  showTracks,
  tab,
} from "../../state/store";
import { say, sayWith } from "../../words/say";
import { Button, flips, sets } from "../parts/Controls";
import { GoTo } from "./GoTo";

/** Buttons on the map's edge: show the area, measure, what is drawn, look at it in space. */
export function MapTools({ onFit }: { onFit: () => void }) {
  const measuring = measured.value !== null;
  return (
    <>
      <div class="map-tools" role="toolbar" aria-label={say("mapTools.mapTools")}>
        <Tool label={say("mapTools.showTheWholeArea")} onClick={onFit}>
          <path d="M2,7 V2 H7 M13,2 H18 V7 M18,13 V18 H13 M7,18 H2 V13" />
        </Tool>
        <Tool
          label={measuring ? say("mapTools.stopMeasuring") : say("mapTools.measureDistancesClickCorner")}
          pressed={measuring}
          id="measure"
          onClick={() => {
            measured.value = measuring ? null : [];
          }}
        >
          <path d="M2,14 L14,2 L18,6 L6,18 Z M6,10 l2,2 M9,7 l2,2 M12,4 l2,2" />
        </Tool>
        <Tool
          label={goingTo.value ? say("mapTools.closeTheFieldForAPosition") : say("mapTools.goToAPosition")}
          pressed={goingTo.value}
          id="go-to"
          onClick={flips(goingTo)}
        >
          <path d="M10,18 C6,12 4,10 4,7 a6,6 0 0 1 12,0 C16,10 14,12 10,18 Z M10,7 h0.01" />
        </Tool>
        <Tool
          label={
            whyNoPosition() ||
            (followOwn.value ? say("mapTools.hideWhereThisDeviceIs") : say("mapTools.showWhereThisDeviceIs"))
          }
          pressed={followOwn.value}
          id="own-position"
          disabled={whyNoPosition() !== ""}
          onClick={flips(followOwn)}
        >
          <path d="M10,1 V5 M10,15 V19 M1,10 H5 M15,10 H19 M10,5 a5,5 0 1 1 -0.01,0" />
        </Tool>
        <Shown what={say("mapTools.tracks")} signal={showTracks}>
          <path d="M3,17 C3,9 10,13 10,8 S17,9 17,3" />
        </Shown>
        {mission.value?.spec.search ? (
          <Shown what={say("mapTools.whatWasLookedAt")} signal={showSite} id="show-site">
            <path d="M2,10 C5,4 15,4 18,10 C15,16 5,16 2,10 M10,7.5 a2.5,2.5 0 1 1 -0.01,0" />
          </Shown>
        ) : null}
        {mission.value?.targets.length ? (
          <Shown what={say("mapTools.targets")} signal={showTargets} id="show-targets">
            <path d="M10,2 v4 M10,14 v4 M2,10 h4 M14,10 h4 M10,6 a4,4 0 1 1 -0.01,0" />
          </Shown>
        ) : null}
        {ships.value ? (
          <Shown what={say("mapTools.ships")} signal={showShips} id="show-ships">
            <path d="M10,2 L15,17 H5 Z" />
          </Shown>
        ) : null}
        {mission.value?.progress.holidays != null ? (
          <Shown what={say("bottomStrip.holidays")} signal={showHolidays} id="show-holidays">
            <path d="M4,4 H16 V16 H4 Z M4,10 L10,4 M4,16 L16,4 M10,16 L16,10" />
          </Shown>
        ) : null}
        {crossovers.value?.outliers ? (
          <Shown what={say("mapTools.crossingsThatDisagree")} signal={showCrossings} id="show-crossings">
            <path d="M5,5 L15,15 M15,5 L5,15" />
          </Shown>
        ) : null}
        {mission.value?.spec.limits.com_range_m ? (
          <Shown what={say("mapTools.communicationRange")} signal={showRanges}>
            <path d="M10,10 h0.01 M6,14 a6,6 0 1 1 8,0 M3,17 a10,10 0 1 1 14,0" />
          </Shown>
        ) : null}
        <Tool
          label={say("mapTools.positionsIn", {
            it:
              coordinateFormat.value === "decimal"
                ? say("mapTools.decimalDegrees")
                : say("mapTools.degreesAndMinutes"),
          })}
          pressed={coordinateFormat.value === "minutes"}
          id="coordinates"
          onClick={() => {
            coordinateFormat.value = coordinateFormat.value === "decimal" ? "minutes" : "decimal";
          }}
        >
          <circle cx="6" cy="5" r="2.5" />
          <path d="M14,4 v5 M4,12 h12 M4,17 h12" />
        </Tool>
        <Tool
          label={say("mapTools.lookAtTheSeaFloorIn")}
          id="open-3d"
          disabled={!seaFloor.value}
          onClick={sets(in3d, true)}
        >
          <path d="M2,13 L8,5 L12,10 L14,8 L18,13 M2,13 L10,18 L18,13" />
        </Tool>
      </div>
      <div class="beside-tools">
        {goingTo.value ? <GoTo /> : null}
        {ownFault.value ? (
          <p class="tool-note reason warning" role="status" data-testid="own-fault">
            {ownFault.value}
          </p>
        ) : null}
        {measuring ? <Measured /> : null}
      </div>
    </>
  );
}

function Measured() {
  const points = measured.value ?? [];
  const legs = points.slice(1).map((to, i) => wayBetween(points[i] as typeof to, to));
  const last = legs.at(-1);
  return (
    <output class="measured" data-testid="measured">
      {last ? (
        <>
          <span>
            {sayWith("mapTools.lastAt", {
              b: <b>{distance(last.metres, 1)}</b>,
              bearingDeg: direction(last.bearing_deg),
            })}
          </span>
          <span>
            {sayWith("mapTools.altogether", {
              b: (
                <b data-testid="measured-all">
                  {distance(
                    legs.reduce((sum, leg) => sum + leg.metres, 0),
                    1,
                  )}
                </b>
              ),
            })}
          </span>
          <Button kind="link-button" onClick={sets(measured, [])}>
            {say("mapTools.anew")}
          </Button>
          {mission.value ? (
            <Button
              id="measured-profile"
              kind="link-button"
              onClick={() => {
                tab.value = "profile";
              }}
            >
              {say("profile.profile")}
            </Button>
          ) : null}
        </>
      ) : (
        <span>{say("mapTools.clickOnTheMapCornerAfter")}</span>
      )}
    </output>
  );
}

interface ToolProps {
  label: string;
  pressed?: boolean;
  disabled?: boolean;
  id?: string;
  onClick: () => void;
  children: ComponentChildren;
}

/** Shows or hides something. */
function Shown({
  what,
  signal,
  ...rest
}: { what: string; signal: Signal<boolean> } & Pick<ToolProps, "id" | "children">) {
  return (
    <Tool
      label={`${what}: ${signal.value ? say("mapTools.shown") : say("mapTools.hidden")}`}
      pressed={signal.value}
      onClick={flips(signal)}
      {...rest}
    />
  );
}

function Tool({ label, pressed, disabled = false, id, onClick, children }: ToolProps) {
  return (
    <button
      type="button"
      class="tool"
      title={label}
      aria-label={label}
      {...(pressed === undefined ? {} : { "aria-pressed": pressed })}
      disabled={disabled}
      data-testid={id}
      onClick={onClick}
    >
      <svg viewBox="0 0 20 20" width="18" height="18" aria-hidden="true">
        <g
          fill="none"
          stroke="currentColor"
          stroke-width="1.8"
          stroke-linecap="round"
          stroke-linejoin="round"
        >
          {children}
        </g>
      </svg>
    </button>
  );
}
