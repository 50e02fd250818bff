import "./Notices.css";
import { useSignal } from "@preact/signals";
import { signedOut } from "../state/access";
import { emptyDraft, toMission } from "../state/draft";
import { createMission, refusal, said } from "../state/session";
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
} from "../state/store";
import { SignIn } from "./Account";
import { Button, sets } from "./Controls";

/** What stands in the middle when there is nothing to show, or something is wrong: always with what to do next. */
export function Notices() {
  const fault = serviceFault.value;
  const refused = refusal.value;
  return (
    <div class="notices">
      {signedOut.value ? <SignIn /> : null}
      {fault && !signedOut.value ? (
        <p class="notice alarm" role="alert" data-testid="service-fault">
          <b>✕ {fault.message}.</b> {fault.remedy} This page connects again by itself
          {mission.value ? "; what is shown is old." : "."}
        </p>
      ) : null}
      {refused && !/^(abort|finish)/.test(refused.what) && !preflightOpen.value ? (
        <div class="notice alarm" role="alert" data-testid="refusal">
          <p>
            <b>✕ {refused.what} was refused:</b> {refused.error.message}. {refused.error.remedy}
          </p>
          <Button onClick={sets(refusal, null)}>Taken</Button>
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
        <b>There is no mission {selectedId.value}.</b> Choose one from the list on the left.
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
        name: "Trial with two simulated vehicles",
        steps: "60",
      };
      await createMission(toMission(draft));
      preflightOpen.value = true;
    } catch (error) {
      fault.value = said(error);
    }
  };
  return (
    <div class="notice" data-testid="no-mission">
      <p>
        <b>No mission is shown.</b>{" "}
        {none ? "Describe the first one." : "Choose one from the list, or describe a new one."}{" "}
        {heard > 0
          ? `${heard} vehicle${heard > 1 ? "s are" : " is"} heard.`
          : "No vehicle is heard yet: switch one on within reach, see Links for what is missing, or try it with simulated ones."}
      </p>
      <Button
        kind="command primary"
        onClick={() => {
          panelOpen.value = true;
          describing.value = none;
        }}
      >
        {none ? "New mission" : "Show missions"}
      </Button>
      <Button id="try" commands onClick={() => void tryIt()}>
        Try with two simulated vehicles
      </Button>
      <Button onClick={sets(linksOpen, true)}>Links</Button>
      {fault.value ? <p class="fault">{fault.value}</p> : null}
    </div>
  );
}
