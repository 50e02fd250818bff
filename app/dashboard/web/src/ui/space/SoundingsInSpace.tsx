import "./SoundingsInSpace.css";
import { effect, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { SoundingState } from "../../api/types";
import type { Pixel } from "../../map/canvas/polylines";
import { colourAt, DEPTH_PALETTES, type Palette } from "../../map/picture/palette";
import { frameRing, within } from "../../map/space/lasso";
import type { SeaFloorScene } from "../../map/space/scene";
import {
  type Cloud,
  chosenPoints,
  cloud,
  donePoints,
  forgetCloud,
  loadCloud,
  MOST_POINTS,
  type Ruling,
  refusedPoints,
  ruleChosen,
  takeBack,
} from "../../state/analysis/cloud";
import { count } from "../../state/format";
import { said } from "../../state/session";
import { depthPalette, rangeOf, selectedId } from "../../state/store";
import { say } from "../../words/say";
import { Button, flips, Typed } from "../parts/Controls";

type Colour = readonly [red: number, green: number, blue: number];
const CHOSEN: Colour = [1, 0.1, 0.9];
/** What is simply used has the colour of its depth. */
const COLOURS: Partial<Record<SoundingState, Colour>> = {
  rejected: [0.88, 0.27, 0.18],
  withdrawn: [0.45, 0.45, 0.45],
  doubted: [1, 0.82, 0.3],
  restored: [0.3, 0.85, 0.35],
};

/** Colours in space are mixed as light is. */
const linear = (part: number) => (part / 255) ** 2.2;

function coloursOf(points: Cloud, chosen: readonly number[], palette: Palette, low: number, high: number) {
  const colours = new Float32Array(3 * points.id.length);
  points.state.forEach((state, i) => {
    const own = COLOURS[state];
    if (own)
      colours.set(
        own.map((part) => part ** 2.2),
        3 * i,
      );
    else {
      const [r, g, b] = colourAt(palette, points.depth_m[i] as number, low, high);
      colours.set([linear(r), linear(g), linear(b)], 3 * i);
    }
  });
  for (const i of chosen)
    colours.set(
      CHOSEN.map((part) => part ** 2.2),
      3 * i,
    );
  return colours;
}

/** Steps of the frame that the keyboard moves, pixels; with Shift the fine ones. */
const [STEP_PX, FINE_PX] = [20, 4];
const [LEAST_PX, MOST_PX] = [8, 600];
const GROWS = 1.25;

/** All soundings as points in space; a lasso, or a frame moved by the keyboard, chooses some to be decided about. */
export function SoundingsInSpace({ scene }: { scene: SeaFloorScene }) {
  const fault = useSignal("");
  const busy = useSignal(false);
  const note = useSignal("");
  const floor = useSignal(false);
  const lasso = useSignal(true);
  const mission = selectedId.value ?? "";

  useEffect(() => {
    const gone = new AbortController();
    forgetCloud();
    loadCloud(mission, gone.signal).catch((error: unknown) => {
      if (!gone.signal.aborted) fault.value = said(error);
    });
    let drawn = 0;
    const stops = [
      effect(() => {
        const points = cloud.value;
        if ((points?.id.length ?? 0) !== drawn) scene.setSoundings(points);
        drawn = points?.id.length ?? 0;
        const range = rangeOf("depth");
        if (!points || !range) return;
        const { palette } = DEPTH_PALETTES[depthPalette.value];
        scene.colourSoundings(coloursOf(points, chosenPoints.value, palette, range.low, range.high));
      }),
      effect(() => scene.setFloorShown(floor.value)),
    ];
    return () => {
      gone.abort();
      for (const stop of stops) stop();
      forgetCloud();
      scene.setSoundings(null);
      scene.setFloorShown(true);
    };
  }, [scene, mission]);

  const act = async (what: () => Promise<void>) => {
    if (busy.value) return;
    busy.value = true;
    fault.value = "";
    try {
      await what();
      note.value = "";
    } catch (error) {
      fault.value = said(error);
    } finally {
      busy.value = false;
    }
  };
  const rule = (ruling: Ruling) => void act(() => ruleChosen(mission, ruling, note.value.trim()));
  const undo = () => void act(() => takeBack(mission, note.value.trim()));
  const points = cloud.value;
  const chosen = chosenPoints.value.length;
  return (
    <>
      {lasso.value ? <Lasso scene={scene} onReject={() => rule("reject")} onUndo={undo} /> : null}
      <div class="points-tools" data-testid="points">
        <p role="status" data-testid="points-chosen">
          {points === null
            ? say("space.soundingsAreRead")
            : chosen > 0
              ? say("space.chosenOf", { chosen: count(chosen), all: count(points.id.length) })
              : say("space.drawRound", { all: count(points.id.length) })}
          {points && points.total > points.id.length && points.id.length >= MOST_POINTS
            ? ` ${say("space.onlyTheFirst", { total: count(points.total) })}`
            : ""}
        </p>
        <div class="buttons">
          <Button
            id="points-reject"
            kind="command primary"
            commands
            disabled={chosen === 0}
            busy={busy.value}
            onClick={() => rule("reject")}
          >
            {say("review.reject")}
          </Button>
          <Button
            id="points-restore"
            commands
            disabled={chosen === 0}
            busy={busy.value}
            onClick={() => rule("restore")}
          >
            {say("review.restore")}
          </Button>
          <Button
            id="points-undo"
            commands
            disabled={donePoints.value.length === 0}
            busy={busy.value}
            onClick={undo}
          >
            {say("space.undo")}
          </Button>
          <Button id="toggle-lasso" aria-pressed={lasso.value} onClick={flips(lasso)}>
            {say("space.lasso")}
          </Button>
          <Button aria-pressed={floor.value} onClick={flips(floor)} id="points-floor">
            {say("space.seaFloor")}
          </Button>
          <Typed
            text={note}
            label={say("review.whyKeptInTheLog")}
            placeholder={say("review.whyKeptInTheLog2")}
            maxLength={500}
            id="points-note"
          />
        </div>
        <Key />
        {refusedPoints.value ? (
          <p class="reason warning" role="alert">
            {say("space.notRestored", {
              count: count(refusedPoints.value.count),
              reason: refusedPoints.value.reason,
            })}
          </p>
        ) : null}
        {fault.value ? (
          <p class="reason alarm" role="alert">
            {fault.value}
          </p>
        ) : null}
      </div>
    </>
  );
}

/** What the colours mean. */
function Key() {
  const words: Record<string, string> = {
    doubted: say("review.leftOutByTheMap"),
    rejected: say("review.keptOutByTheGate"),
    withdrawn: say("review.keptOutByAnOperator"),
    restored: say("review.restored"),
  };
  return (
    <p class="points-key">
      {Object.entries(words).map(([state, text]) => (
        <span key={state}>
          <i style={{ background: css(COLOURS[state as SoundingState] as Colour) }} aria-hidden="true" />{" "}
          {text}
        </span>
      ))}
      <span>
        <i style={{ background: css(CHOSEN) }} aria-hidden="true" /> {say("space.chosen")}
      </span>
    </p>
  );
}

const css = (colour: Colour) => `rgb(${colour.map((part) => Math.round(part * 255)).join(" ")})`;

interface LassoProps {
  scene: SeaFloorScene;
  onReject: () => void;
  onUndo: () => void;
}

/** Drawn round points with the pointer, or a round frame for the keyboard; two fingers and the wheel turn the view. */
function Lasso({ scene, onReject, onUndo }: LassoProps) {
  const ring = useSignal<readonly Pixel[]>([]);
  const frame = useSignal<{ x: number; y: number; radius: number } | null>(null);
  const box = useRef<SVGSVGElement>(null);
  const choose = (round: readonly Pixel[], more: boolean) => {
    const found = within(scene.soundingsOnScreen(), round);
    chosenPoints.value = more ? [...new Set([...chosenPoints.value, ...found])] : found;
  };
  const pixel = (event: PointerEvent): Pixel => {
    const { left, top } = (box.current as SVGSVGElement).getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  };
  const middle = () => {
    const { width, height } = (box.current as SVGSVGElement).getBoundingClientRect();
    return { x: width / 2, y: height / 2, radius: 80 };
  };
  const key = (event: KeyboardEvent) => {
    const at = frame.value ?? middle();
    const step = event.shiftKey ? FINE_PX : STEP_PX;
    const radius = (times: number) => Math.min(Math.max(at.radius * times, LEAST_PX), MOST_PX);
    const keys: Record<string, () => void> = {
      ArrowLeft: () => {
        frame.value = { ...at, x: at.x - step };
      },
      ArrowRight: () => {
        frame.value = { ...at, x: at.x + step };
      },
      ArrowUp: () => {
        frame.value = { ...at, y: at.y - step };
      },
      ArrowDown: () => {
        frame.value = { ...at, y: at.y + step };
      },
      "+": () => {
        frame.value = { ...at, radius: radius(GROWS) };
      },
      "-": () => {
        frame.value = { ...at, radius: radius(1 / GROWS) };
      },
      Enter: () => choose(frameRing(at), event.shiftKey),
      Escape: () => {
        chosenPoints.value = [];
      },
      Delete: onReject,
      ...(event.ctrlKey || event.metaKey ? { z: onUndo } : {}),
    };
    const does = keys[event.key];
    if (!does) return;
    event.preventDefault();
    event.stopPropagation();
    does();
  };
  return (
    <svg
      ref={box}
      class="lasso"
      role="application"
      // biome-ignore lint/a11y/noNoninteractiveTabindex: the keyboard moves its frame
      tabIndex={0}
      aria-label={say("space.lassoKeys")}
      data-testid="lasso"
      onKeyDown={key}
      onFocus={(event) => {
        if (event.currentTarget.matches(":focus-visible")) frame.value ??= middle();
      }}
      onBlur={() => {
        frame.value = null;
      }}
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        frame.value = null;
        ring.value = [pixel(event)];
      }}
      onPointerMove={(event) => {
        if (ring.value.length > 0) ring.value = [...ring.value, pixel(event)];
      }}
      onPointerUp={(event) => {
        choose(ring.value, event.shiftKey);
        ring.value = [];
      }}
      onPointerCancel={() => {
        ring.value = [];
      }}
      onWheel={(event) => {
        scene.canvas.dispatchEvent(new WheelEvent("wheel", event));
      }}
    >
      {ring.value.length > 1 ? <polygon points={ring.value.map((p) => p.join()).join(" ")} /> : null}
      {frame.value ? <circle cx={frame.value.x} cy={frame.value.y} r={frame.value.radius} /> : null}
    </svg>
  );
}
