import "./App.css";
import { useEffect, useRef } from "preact/hooks";
import { signedOut } from "../state/access";
import { dialogOpen, in3d, mission, panelOpen, stripHeight } from "../state/store";
import { AbortDialog } from "./AbortDialog";
import { AccountDialog } from "./Account";
import { Attention } from "./Attention";
import { BottomStrip } from "./BottomStrip";
import { ChartPane } from "./ChartPane";
import { FinishDialog } from "./FinishDialog";
import { FleetDialog } from "./FleetDialog";
import { Heard, Others } from "./Heard";
import { KeysDialog } from "./KeysDialog";
import { watchKeys } from "./keys";
import { Legend } from "./Legend";
import { LinksDialog } from "./LinksDialog";
import { MapMenu } from "./MapMenu";
import { MissionPanel } from "./MissionPanel";
import { Notices } from "./Notices";
import { PreflightDialog } from "./PreflightDialog";
import { watchPrinting } from "./printing";
import { Readout } from "./Readout";
import { cardsWidth, legendReach, paneHeight, panelWidth, shownFolded, watchRoom } from "./room";
import { SettingsDialog } from "./SettingsDialog";
import { SpaceView } from "./SpaceView";
import { TopBar } from "./TopBar";
import { Tour } from "./Tour";
import { VehicleCards } from "./VehicleCards";
import { DenserQuestion } from "./VehicleOrders";

/** Before the strip's height was measured. */
const LEAST_STRIP_PX = 106;

/** Panels leave room for the map, however large they were made on a larger screen. */
const MOST_OF_WINDOW = { across: "36vw", up: "60vh" };

const sized = (name: string, size: number | null, most: string) =>
  size === null ? {} : { [name]: `min(${size}px, ${most})` };

export function App() {
  const root = useRef<HTMLDivElement>(null);
  useEffect(() => {
    // The bar wraps as the window says: dialogs begin below it.
    const bar = root.current?.querySelector<HTMLElement>(".top-bar");
    if (!bar) return;
    const watcher = new ResizeObserver(() => {
      root.current?.style.setProperty("--below-bar", `${bar.getBoundingClientRect().bottom}px`);
    });
    watcher.observe(bar);
    return () => watcher.disconnect();
  }, []);
  useEffect(() => (root.current ? watchRoom(root.current) : undefined), []);
  useEffect(watchKeys, []);
  useEffect(() => (root.current ? watchPrinting(root.current) : undefined), []);
  // What lies under a dialog is out of reach; the top bar with the stop never is.
  const covered = dialogOpen.value;
  const classes = [
    "app",
    panelOpen.value && !signedOut.value ? "with-missions" : "",
    mission.value ? "with-mission" : "",
    shownFolded.value ? "folded-cards" : "",
  ];
  const { top, bottom } = legendReach.value;
  const sizes = {
    "--strip": `${Math.max(LEAST_STRIP_PX, stripHeight.value)}px`,
    "--legend-top": `${top}px`,
    "--legend-bottom": `${bottom}px`,
    ...sized("--left", panelWidth.value, MOST_OF_WINDOW.across),
    ...(shownFolded.value ? {} : sized("--right", cardsWidth.value, MOST_OF_WINDOW.across)),
    ...sized("--pane", paneHeight.value, MOST_OF_WINDOW.up),
  };
  return (
    <div ref={root} class={classes.join(" ")} style={sizes}>
      <TopBar />
      <main class="stage" inert={covered}>
        <ChartPane />
        {in3d.value ? <SpaceView /> : <Readout />}
        <Legend />
        <div class="over-map">
          <Attention />
          <Others />
          <Tour />
          <Notices />
          <DenserQuestion />
        </div>
      </main>
      <div class="around" inert={covered}>
        {panelOpen.value && !signedOut.value ? <MissionPanel /> : null}
        <VehicleCards />
        <BottomStrip />
      </div>
      <MapMenu />
      <PreflightDialog />
      <AbortDialog />
      <LinksDialog />
      <FleetDialog />
      <FinishDialog />
      <AccountDialog />
      <SettingsDialog />
      <KeysDialog />
      <Heard />
    </div>
  );
}
