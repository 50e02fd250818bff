import { in3d, mission, panelOpen, stripHeight } from "../state/store";
import { AbortDialog } from "./AbortDialog";
import { BottomStrip } from "./BottomStrip";
import { ChartPane } from "./ChartPane";
import { Alarms } from "./EventLog";
import { FleetDialog } from "./FleetDialog";
import { Legend } from "./Legend";
import { LinksDialog } from "./LinksDialog";
import { MissionPanel } from "./MissionPanel";
import { Notices } from "./Notices";
import { PreflightDialog } from "./PreflightDialog";
import { Readout } from "./Readout";
import { SpaceView } from "./SpaceView";
import { TopBar } from "./TopBar";
import { VehicleCards } from "./VehicleCards";

/** Before the strip's height was measured. */
const LEAST_STRIP_PX = 106;

export function App() {
  const classes = ["app", panelOpen.value ? "with-missions" : "", mission.value ? "with-mission" : ""];
  return (
    <div class={classes.join(" ")} style={{ "--strip": `${Math.max(LEAST_STRIP_PX, stripHeight.value)}px` }}>
      <TopBar />
      <main class="stage">
        <ChartPane />
        {in3d.value ? <SpaceView /> : <Readout />}
        <Legend />
        <div class="over-map">
          <Alarms />
          <Notices />
        </div>
      </main>
      {panelOpen.value ? <MissionPanel /> : null}
      <VehicleCards />
      <BottomStrip />
      <PreflightDialog />
      <AbortDialog />
      <LinksDialog />
      <FleetDialog />
    </div>
  );
}
