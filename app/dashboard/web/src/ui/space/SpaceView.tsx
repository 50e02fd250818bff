import "./SpaceView.css";
import { effect, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { DEPTH_PALETTES } from "../../map/picture/palette";
import type { SceneVehicle, SeaFloorScene } from "../../map/space/scene";
import { replayed } from "../../state/past/replay";
import {
  depthPalette,
  in3d,
  isDark,
  rangeOf,
  seaFloor,
  shownCertainty,
  theme,
  vehicles,
  view,
} from "../../state/store";
import { say } from "../../words/say";
import { Button, flips, sets } from "../parts/Controls";
import { SoundingsInSpace } from "./SoundingsInSpace";

/** The sea floor in space over the whole map. */
export function SpaceView() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const exaggeration = useSignal(4);
  const fault = useSignal("");
  const reset = useRef(() => {});
  const scene = useSignal<SeaFloorScene | null>(null);
  const points = useSignal(false);

  useEffect(() => {
    const element = canvas.current;
    if (!element) return;
    let stop = () => {};
    let closed = false;
    import("../../map/space/scene").then(
      ({ SeaFloorScene: Made }) => {
        if (closed) return;
        const made = new Made(element);
        reset.current = () => made.lookFromSouth();
        const watcher = new ResizeObserver(() => made.resize(element.clientWidth, element.clientHeight));
        watcher.observe(element);
        const stops = [
          effect(() => {
            const contrast = theme.value === "contrast";
            made.setBackground(contrast ? "#ffffff" : isDark.value ? "#0c1922" : "#dfe9f0");
          }),
          effect(() => made.setExaggeration(exaggeration.value)),
          effect(() => {
            const map = seaFloor.value;
            const range = rangeOf("depth");
            const certainty = shownCertainty.value;
            if (map && range && certainty) {
              made.setSeaFloor(map, DEPTH_PALETTES[depthPalette.value].palette, range, certainty);
            }
          }),
          effect(() => made.setVehicles(seaFloor.value ? fleetInSpace() : [])),
        ];
        scene.value = made;
        stop = () => {
          scene.value = null;
          for (const one of stops) one();
          watcher.disconnect();
          made.close();
        };
      },
      (error: unknown) => {
        fault.value = String(error);
      },
    );
    return () => {
      closed = true;
      stop();
    };
  }, []);

  return (
    <section class="space" aria-label={say("space.seaFloorInSpace")} data-testid="space">
      <canvas ref={canvas} tabIndex={0} aria-label={say("space.seaFloorDragToTurnIt")} />
      <div class="space-tools">
        <label class="field">
          {say("space.heightsX", { exaggeration: exaggeration.value })}
          <input
            type="range"
            min={1}
            max={20}
            value={exaggeration.value}
            data-testid="exaggeration"
            onInput={(event) => {
              exaggeration.value = Number(event.currentTarget.value);
            }}
          />
        </label>
        <Button onClick={() => reset.current()}>{say("space.fromTheSouth")}</Button>
        <Button id="toggle-points" aria-pressed={points.value} onClick={flips(points)}>
          {say("space.soundings")}
        </Button>
        <Button id="close-3d" kind="command primary" onClick={sets(in3d, false)}>
          {say("space.backToTheMap")}
        </Button>
      </div>
      {points.value && scene.value ? <SoundingsInSpace scene={scene.value} /> : null}
      {fault.value ? (
        <p class="notice alarm" role="alert">
          {say("space.itCannotBeShownInSpace", { fault: fault.value })}
        </p>
      ) : null}
    </section>
  );
}

function fleetInSpace(): SceneVehicle[] {
  const past = replayed.value;
  if (past) {
    return past.map((p) => ({
      name: p.vehicle,
      colour: p.colour,
      place: p.place,
      depth_m: p.depth_m,
      heading_deg: null,
      way: p.track.map(([lng, lat], i) => [lng, lat, p.depths_m[i]]),
    }));
  }
  return vehicles.value.map(({ view: v, colour }) => {
    const track = view.value.tracks[v.name];
    return {
      name: v.name,
      colour,
      place: v.lon_deg === null || v.lat_deg === null ? null : [v.lon_deg, v.lat_deg],
      depth_m: v.depth_m,
      heading_deg: v.heading_deg,
      way: track ? [...track.old, ...track.tail] : [],
    };
  });
}
