import "./Grip.css";
import type { Signal } from "@preact/signals";
import { useRef } from "preact/hooks";
import { say } from "../../words/say";

interface GripProps {
  /** What is made larger and smaller. */
  what: string;
  size: Signal<number | null>;
  /** Of the element that the grip is in: the side it lies at. */
  side: "left" | "right" | "top";
  least: number;
  most: number;
  id: string;
}

/** By how much an arrow key changes a size, pixels. */
const STEP_PX = 24;

/** The edge of a panel: dragged, or moved with the arrow keys; a double click takes the size back. */
export function Grip({ what, size, side, least, most, id }: GripProps) {
  const grip = useRef<HTMLHRElement>(null);
  const dragged = useRef<{ from: number; size: number } | null>(null);
  const upright = side !== "top";
  const present = () => {
    const panel = grip.current?.parentElement?.getBoundingClientRect();
    return size.peek() ?? (panel ? (upright ? panel.width : panel.height) : least);
  };
  const set = (value: number) => {
    size.value = Math.round(Math.min(most, Math.max(least, value)));
  };
  const place = (event: PointerEvent) => (upright ? event.clientX : -event.clientY);
  const sign = side === "left" ? -1 : 1;
  const KEYS: Readonly<Record<string, number>> = upright
    ? { ArrowLeft: -sign, ArrowRight: sign }
    : { ArrowUp: 1, ArrowDown: -1 };
  return (
    <hr
      ref={grip}
      class={`grip ${side}`}
      tabIndex={0}
      aria-label={say("grip.sizeOf", { what })}
      aria-orientation={upright ? "vertical" : "horizontal"}
      aria-valuemin={least}
      aria-valuemax={most}
      aria-valuenow={size.value ?? least}
      aria-valuetext={size.value === null ? say("grip.asUsual") : say("grip.pixels", { size: size.value })}
      title={say("grip.dragToChangeTheSizeOf", { what })}
      data-testid={id}
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        dragged.current = { from: place(event), size: present() };
      }}
      onPointerMove={(event) => {
        const began = dragged.current;
        if (began) set(began.size + sign * (place(event) - began.from));
      }}
      onPointerUp={() => {
        dragged.current = null;
      }}
      onPointerCancel={() => {
        dragged.current = null;
      }}
      onDblClick={() => {
        size.value = null;
      }}
      onKeyDown={(event) => {
        const way = KEYS[event.key];
        if (way === undefined) return;
        event.preventDefault();
        set(present() + way * STEP_PX);
      }}
    />
  );
}
