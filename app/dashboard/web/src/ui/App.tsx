import "./App.css";
import { useEffect, useRef } from "preact/hooks";
import { signedOut } from "../state/access";
import { describing, dialogOpen, in3d, mission, panelOpen, stripHeight } from "../state/store";
import { AccountDialog } from "./Account";
import { VehicleCards } from "./cards/VehicleCards";
import { DenserQuestion } from "./cards/VehicleOrders";
import { ChartPane } from "./chart/ChartPane";
import { Legend } from "./chart/Legend";
import {
  cardsWidth,
  legendReach,
  mapFirst,
  paneHeight,
  panelWidth,
  shownFolded,
  watchRoom,
} from "./chart/layout";
import { MapMenu } from "./chart/MapMenu";
import { MapPrompt } from "./chart/MapPrompt";
import { Readout } from "./chart/Readout";
import { AbortDialog } from "./dialogs/AbortDialog";
import { FinishDialog } from "./dialogs/FinishDialog";
import { FleetDialog } from "./dialogs/FleetDialog";
import { KeysDialog } from "./dialogs/KeysDialog";
import { LengthDialog } from "./dialogs/LengthDialog";
import { LinksDialog } from "./dialogs/LinksDialog";
import { PreflightDialog } from "./dialogs/PreflightDialog";
import { SettingsDialog } from "./dialogs/SettingsDialog";
import { watchKeys } from "./keys";
import { MissionPanel } from "./MissionPanel";
import { Attention } from "./notices/Attention";
import { Heard, Others } from "./notices/Heard";
import { Notices } from "./notices/Notices";
import { keepFocus } from "./parts/keptFocus";
import { watchPrinting } from "./parts/printMap";
import { SitesDialog } from "./sites/SitesDialog";
import { SpaceView } from "./space/SpaceView";
import { BottomStrip } from "./strip/BottomStrip";
import { TopBar } from "./TopBar";
import { Tour } from "./Tour";

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
  useEffect(() => (root.current ? keepFocus(root.current) : undefined), []);
  useEffect(() => (root.current ? watchPrinting(root.current) : undefined), []);
  // What lies under a dialog is out of reach; the top bar with the stop never is.
  const covered = dialogOpen.value;
  const classes = [
    "app",
    panelOpen.value && !signedOut.value ? "with-missions" : "",
    mission.value ? "with-mission" : "",
    shownFolded.value ? "folded-cards" : "",
    mapFirst.value ? "map-first" : "",
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
          <MapPrompt />
          <Attention />
          <Others />
          <Tour />
          <Notices />
          <DenserQuestion />
        </div>
      </main>
      <div class="around" inert={covered}>
        {(panelOpen.value || describing.value) && !signedOut.value ? <MissionPanel /> : null}
        <VehicleCards />
        <BottomStrip />
      </div>
      <MapMenu />
      <PreflightDialog />
      <AbortDialog />
      <LinksDialog />
      <FleetDialog />
      <SitesDialog />
      <FinishDialog />
      <LengthDialog />
      <AccountDialog />
      <SettingsDialog />
      <KeysDialog />
      <Heard />
    </div>
  );
}
