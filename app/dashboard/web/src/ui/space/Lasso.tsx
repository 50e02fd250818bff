import { useSignal } from "@preact/signals";
import { useRef } from "preact/hooks";
import type { Pixel } from "../../map/canvas/polylines";
import { frameRing, within } from "../../map/space/lasso";
import type { SeaFloorScene } from "../../map/space/scene";
import { chosenPoints } from "../../state/analysis/cloud";
import { say } from "../../words/say";

/** Steps of the frame that the keyboard moves, pixels; with Shift the fine ones. */
const [STEP_PX, FINE_PX] = [20, 4];
const [LEAST_PX, MOST_PX] = [8, 600];
const GROWS = 1.25;

interface LassoProps {
  scene: SeaFloorScene;
  onReject: () => void;
  onUndo: () => void;
}

/** Drawn round points with the pointer, or a round frame for the keyboard; two fingers and the wheel turn the view. */
export function Lasso({ scene, onReject, onUndo }: LassoProps) {
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
