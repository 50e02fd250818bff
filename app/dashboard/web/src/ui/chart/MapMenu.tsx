import "./MapMenu.css";
import { useLayoutEffect, useRef } from "preact/hooks";
import { whyNotCommand } from "../../state/access";
import { distance, place } from "../../state/format";
import { drawDenser, goVehicle, mapMenu, repeatLine } from "../../state/orders/orders";
import { nearestTo } from "../../state/orders/orderWords";
import { coordinateFormat, marked, measured, mission } from "../../state/store";
import { say } from "../../words/say";

const WIDTH_PX = 250;
const LINE_PX = 40;

/** What can be done about a place on the map: opened with the right button, a long touch, or the menu key. */
export function MapMenu() {
  const menu = mapMenu.value;
  const box = useRef<HTMLDivElement>(null);
  // What is seen can be left at once: other effects wait until it is painted.
  useLayoutEffect(() => {
    if (!menu) return;
    box.current?.querySelector<HTMLElement>("[role=menuitem]:not(:disabled)")?.focus();
    const leave = (event: Event) => {
      const outside = event.target instanceof Node && !box.current?.contains(event.target);
      if (event instanceof KeyboardEvent ? event.key === "Escape" : outside) mapMenu.value = null;
    };
    window.addEventListener("keydown", leave);
    window.addEventListener("pointerdown", leave, true);
    return () => {
      window.removeEventListener("keydown", leave);
      window.removeEventListener("pointerdown", leave, true);
    };
  }, [menu]);
  if (!menu) return null;
  const present = mission.value;
  const surveys = present && present.spec.kind !== "search" && whyNotCommand.value === "";
  const able = surveys ? nearestTo(menu.at, present, present.vehicles) : [];
  const lines = able.length > 0 ? 2 * able.length + 3 : 2;
  const left = Math.max(4, Math.min(menu.x, window.innerWidth - WIDTH_PX - 8));
  const top = Math.max(4, Math.min(menu.y, window.innerHeight - LINE_PX * lines - 30));
  const step = (event: KeyboardEvent) => {
    const way = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!way) return;
    event.preventDefault();
    const items = [...(box.current?.querySelectorAll<HTMLElement>("[role=menuitem]") ?? [])];
    const here = items.indexOf(document.activeElement as HTMLElement);
    items[(here + way + items.length) % items.length]?.focus();
  };
  const item = (id: string, words: string, act: () => void) => (
    <button
      key={id}
      type="button"
      role="menuitem"
      data-testid={`menu-${id}`}
      onClick={() => {
        mapMenu.value = null;
        act();
      }}
    >
      {words}
    </button>
  );
  return (
    <div
      ref={box}
      class="map-menu"
      role="menu"
      tabIndex={-1}
      aria-label={say("mapMenu.whatToDoHere")}
      data-testid="map-menu"
      style={{ left: `${left}px`, top: `${top}px` }}
      onKeyDown={step}
    >
      <p>{place(menu.at, coordinateFormat.value)}</p>
      {able.map(({ name, away_m }) =>
        item(
          `go-${name}`,
          say("mapMenu.sendHere", { name, away: distance(away_m) }),
          () => void goVehicle(name, menu.at),
        ),
      )}
      {able.map(({ name }) =>
        item(`repeat-${name}`, say("mapMenu.lineAgain", { name }), () => void repeatLine(name, menu.at)),
      )}
      {able.length > 0 ? item("denser", say("mapMenu.denser"), drawDenser) : null}
      {item("measure", say("mapMenu.measure"), () => {
        measured.value = [menu.at];
      })}
      {item("mark", say("mapMenu.mark"), () => {
        marked.value = { at: menu.at };
      })}
    </div>
  );
}
