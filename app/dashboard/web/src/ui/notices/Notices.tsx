import "./Notices.css";
import { useSignal } from "@preact/signals";
import { signedOut } from "../../state/access";
import { emptyDraft, toMission } from "../../state/form/draft";
import { createMission, refusal, said } from "../../state/session";
import {
  describing,
  fleet,
  linksOpen,
  mapCentre,
  mission,
  missions,
  panelOpen,
  preflightOpen,
  selectedId,
  serviceFault,
  socketStatus,
} from "../../state/store";
import { say, sayWith } from "../../words/say";
import { SignIn } from "../Account";
import { chartFault } from "../chart/mapPicture";
import { Button, sets } from "../parts/Controls";
import { beginTour } from "../Tour";

/** What stands in the middle when there is nothing to show, or something is wrong: always with what to do next. */
export function Notices() {
  const fault = serviceFault.value;
  const refused = refusal.value;
  return (
    <div class="notices">
      {signedOut.value ? <SignIn /> : null}
      {chartFault.value ? (
        <p class="notice alarm" role="alert" data-testid="map-fault">
          {say("chartPane.theMapCannotBeDrawnIt", { fault: chartFault.value })}
        </p>
      ) : null}
      {fault && !signedOut.value ? (
        <p class="notice alarm" role="alert" data-testid="service-fault">
          {sayWith("notices.thisPageConnectsAgainBy", {
            b: <b>✕ {fault.message}.</b>,
            remedy: fault.remedy,
            it: mission.value ? say("notices.whatIsShownIsOld") : ".",
          })}
        </p>
      ) : null}
      {refused && !refused.inDialog && !preflightOpen.value ? (
        <div class="notice alarm" role="alert" data-testid="refusal">
          <p>
            <b>
              {say(refused.error.status === 0 ? "notices.wasNotAnswered" : "notices.wasRefused", {
                what: refused.what,
              })}
            </b>{" "}
            {refused.error.message}. {refused.error.remedy}
          </p>
          <Button onClick={sets(refusal, null)}>{say("log.taken")}</Button>
        </div>
      ) : null}
      <Guide />
    </div>
  );
}

function Guide() {
  if (signedOut.value || serviceFault.value || missions.value === null || describing.value) return null;
  if (!selectedId.value) return <NoMission none={missions.value.length === 0} />;
  const known = missions.value.some((m) => m.id === selectedId.value);
  if (!mission.value && !known && socketStatus.value?.kind !== "open") {
    return (
      <p class="notice" data-testid="unknown-mission">
        {sayWith("notices.chooseOneFromTheListOn", {
          b: <b>{say("notices.thereIsNoMission", { selectedId: selectedId.value })}</b>,
        })}
      </p>
    );
  }
  return null;
}

/** Nothing is shown: what there is to choose from, and how to try it without a vehicle. */
function NoMission({ none }: { none: boolean }) {
  const fault = useSignal("");
  const heard = fleet.value.filter((v) => v.kind !== "sim").length;
  const tryIt = async () => {
    try {
      const draft = {
        ...emptyDraft(mapCentre.value),
        name: say("notices.trialWithTwoSimulated"),
        steps: "60",
      };
      await createMission(toMission(draft));
      preflightOpen.value = true;
    } catch (error) {
      fault.value = said(error);
    }
  };
  const guide = async () => {
    try {
      await beginTour();
    } catch (error) {
      fault.value = said(error);
    }
  };
  return (
    <div class="notice" data-testid="no-mission">
      <p>
        <b>{say("notices.noMissionIsShown")}</b>{" "}
        {none ? say("notices.describeTheFirstOne") : say("notices.chooseOneFromTheListOr")}{" "}
        {heard > 0 ? say("notices.vehicleIsHeard", { heard }) : say("notices.noVehicleIsHeardYetSwitch")}
      </p>
      <Button
        kind="command primary"
        onClick={() => {
          panelOpen.value = true;
          describing.value = none;
        }}
      >
        {none ? say("mission.newMission") : say("notices.showMissions")}
      </Button>
      <Button id="try" commands onClick={() => void tryIt()}>
        {say("notices.tryWithTwoSimulatedVehicles")}
      </Button>
      <Button id="begin-tour" commands onClick={() => void guide()}>
        {say("tour.begin")}
      </Button>
      <Button onClick={sets(linksOpen, true)}>{say("notices.links")}</Button>
      {fault.value ? <p class="fault">{fault.value}</p> : null}
    </div>
  );
}
