import "./GoTo.css";
import { useSignal } from "@preact/signals";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import type { LngLat } from "../../api/types";
import { type Harbour, harbours, harboursNamed } from "../../map/harbours";
import { placeOf, placeSample } from "../../state/coordinates";
import { destination, goingTo, marked } from "../../state/store";
import { say } from "../../words/say";
import { OwnShip } from "../OwnShip";
import { Button, sets, useEscape } from "../parts/Controls";

/** As much about a place, and about a harbour, as is shown of it, degrees. */
const ABOUT = 0.002;
const ABOUT_HARBOUR = 0.08;
const MOST_FOUND = 7;
const LIST = "harbours-found";
const optionId = (i: number) => `harbour-${i}`;

function show(at: LngLat, about = ABOUT, name?: string): void {
  marked.value = name ? { at, name } : { at };
  destination.value = [at[0] - about, at[1] - about, at[0] + about, at[1] + about];
}

/** Asks for a position in any of the usual ways, or for a harbour by its name, goes there and marks it. */
export function GoTo() {
  const text = useSignal("");
  const fault = useSignal("");
  const known = useSignal<readonly Harbour[]>([]);
  /** Which of those that are found is chosen; null: none is offered. */
  const chosen = useSignal<number | null>(null);
  const field = useRef<HTMLInputElement>(null);
  // Before the first picture of it: who types at once types into the field, not the page's single keys.
  useLayoutEffect(() => {
    const before = document.activeElement;
    field.current?.focus();
    return () => {
      const isHere = field.current?.form?.contains(document.activeElement);
      if (isHere && before instanceof HTMLElement) before.focus();
    };
  }, []);
  useEscape(goingTo, false);
  useEffect(() => {
    // Without the service there are no names, which is told elsewhere.
    harbours().then(
      (all) => {
        known.value = all;
      },
      () => undefined,
    );
  }, []);
  const at = placeOf(text.value);
  const found = at || chosen.value === null ? [] : harboursNamed(known.value, text.value, MOST_FOUND);
  const goToHarbour = (harbour: Harbour) => {
    text.value = harbour.name;
    fault.value = "";
    chosen.value = null;
    show(harbour.at, ABOUT_HARBOUR, harbour.name);
  };
  const go = (event: SubmitEvent) => {
    event.preventDefault();
    const harbour =
      found[chosen.value ?? 0] ?? (at ? undefined : harboursNamed(known.value, text.value, 1)[0]);
    if (harbour) return goToHarbour(harbour);
    const [name, sample] = [text.value.trim(), placeSample()];
    fault.value = at
      ? ""
      : /^\D+$/.test(name)
        ? say("mapTools.noHarbourIsCalled", { name, sample })
        : say("mapTools.typeAPositionSuchAs", { sample });
    if (at) show(at);
  };
  const onKeyDown = (event: KeyboardEvent) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (event.key === "Escape" && found.length > 0) chosen.value = null;
    else if (step && found.length > 0)
      chosen.value = ((chosen.value ?? 0) + step + found.length) % found.length;
    else if (step) chosen.value = 0;
    else return;
    event.preventDefault();
  };
  return (
    <form class="go-to" onSubmit={go}>
      <input
        ref={field}
        type="text"
        role="combobox"
        aria-label={say("mapTools.positionToGoTo")}
        aria-autocomplete="list"
        aria-expanded={found.length > 0}
        aria-controls={LIST}
        aria-activedescendant={found.length > 0 ? optionId(chosen.value ?? 0) : undefined}
        autocomplete="off"
        placeholder={say("mapTools.sample")}
        aria-invalid={fault.value !== ""}
        value={text.value}
        data-testid="go-to-position"
        onInput={(event) => {
          text.value = event.currentTarget.value;
          chosen.value = 0;
        }}
        onKeyDown={onKeyDown}
      />
      <button type="submit" class="command" data-testid="go">
        {say("mapTools.go")}
      </button>
      <div
        id={LIST}
        class="harbours-found"
        role="listbox"
        aria-label={say("mapTools.harbours")}
        hidden={found.length === 0}
      >
        {found.map((harbour, i) => (
          <button
            key={`${harbour.name} ${harbour.at}`}
            id={optionId(i)}
            type="button"
            role="option"
            tabIndex={-1}
            aria-selected={i === chosen.value}
            data-testid={optionId(i)}
            // The field keeps the keyboard.
            onMouseDown={(event) => event.preventDefault()}
            onClick={() => goToHarbour(harbour)}
          >
            {harbour.name}
            <small>{harbour.country}</small>
          </button>
        ))}
      </div>
      <span class="visually-hidden" role="status">
        {found.length > 0 ? say("mapTools.harboursFound", { n: found.length }) : ""}
      </span>
      {found.length > 0 ? <small class="hint">{say("mapTools.toAboutAMile")}</small> : null}
      <OwnShip id="go-to" onPlace={show} />
      {marked.value ? (
        <Button kind="link-button" onClick={sets(marked, null)}>
          {say("mapTools.unmark")}
        </Button>
      ) : null}
      {fault.value ? (
        <span class="fault" role="alert" data-testid="go-to-fault">
          ▲ {fault.value}
        </span>
      ) : null}
    </form>
  );
}
