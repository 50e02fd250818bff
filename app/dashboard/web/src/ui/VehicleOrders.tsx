import "./VehicleOrders.css";
import { useSignal, useSignalEffect } from "@preact/signals";
import type { VehicleView } from "../api/types";
import {
  denserRing,
  goVehicle,
  pickPlaceFor,
  repeatLine,
  skipLine,
  surveyDenser,
  typingFor,
} from "../state/orders";
import { lengthOf, orderWords, takesOrders } from "../state/orderWords";
import { PLACE_SAMPLE, placeOf } from "../state/place";
import { resumeVehicle } from "../state/session";
import { describing, drawing, drawingReady, mission, picking, vehicles } from "../state/store";
import { Button, Choice, into, sets, Typed, useEscape } from "./Controls";

/** What a vehicle was ordered, with the way back to its part. */
export function OrderLine({ of: v }: { of: VehicleView }) {
  if (!v.order || !v.active) return null;
  return (
    <p class="reason order-line" data-testid={`order-${v.name}`}>
      <span aria-hidden="true">➤</span> {orderWords(v.order)}{" "}
      <Button
        id={`end-order-${v.name}`}
        kind="link-button"
        commands
        title="End this order: it goes on with its part of the survey now"
        onClick={() => void resumeVehicle(v.name)}
      >
        Go on with its part
      </Button>
    </p>
  );
}

/** What a vehicle that surveys can be ordered, on its card. */
export function LineOrders({ of: v }: { of: VehicleView }) {
  const present = mission.value;
  if (!present || present.spec.kind === "search" || !takesOrders(present, v)) return null;
  const typing = typingFor.value === v.name;
  return (
    <>
      <Button
        id={`go-${v.name}`}
        commands
        aria-expanded={typing}
        title="Send it to a place now: click on the map or type a position; then it goes on with its part"
        onClick={() => {
          typingFor.value = typing ? null : v.name;
          if (typing) picking.value = null;
          else pickPlaceFor(v.name);
        }}
      >
        Go there…
      </Button>
      <Button
        id={`skip-${v.name}`}
        commands
        title="Leave out the rest of the line that it is on; what it leaves out counts as not surveyed"
        onClick={() => void skipLine(v.name)}
      >
        Skip line
      </Button>
      <Button
        id={`repeat-${v.name}`}
        commands
        title="Fly the line that it is on once more, from its beginning to here"
        onClick={() => void repeatLine(v.name)}
      >
        Line again
      </Button>
      {typing ? <TypedPlace name={v.name} /> : null}
    </>
  );
}

/** Where a vehicle is to go, typed; the map takes a click meanwhile. */
function TypedPlace({ name }: { name: string }) {
  const text = useSignal("");
  const fault = useSignal("");
  useEscape(typingFor);
  useEscape(picking);
  useSignalEffect(() => {
    // The click on the map came.
    if (!picking.value) typingFor.value = null;
  });
  const go = async (event: SubmitEvent) => {
    event.preventDefault();
    const at = placeOf(text.value);
    fault.value = at ? "" : `Type a position such as ${PLACE_SAMPLE}, or click on the map`;
    if (at && (await goVehicle(name, at))) {
      typingFor.value = null;
      picking.value = null;
    }
  };
  return (
    <form class="typed-place" onSubmit={(event) => void go(event)}>
      <Typed
        text={text}
        label={`Where ${name} goes`}
        placeholder="Click on the map, or type"
        id={`go-place-${name}`}
      />
      <button type="submit" class="command" data-testid={`go-send-${name}`}>
        Send
      </button>
      {fault.value ? (
        <span class="fault" role="alert">
          ▲ {fault.value}
        </span>
      ) : null}
    </form>
  );
}

/** Asks how an area that was drawn is to be surveyed denser. */
export function DenserQuestion() {
  const ring = denserRing.value;
  const spacing = useSignal("");
  const who = useSignal("");
  const fault = useSignal("");
  useEscape(denserRing);
  useEscape(drawing);
  const present = mission.value;
  if (drawing.value && drawingReady.value && !describing.value && present)
    return (
      <p class="notice" role="status" data-testid="draws-denser">
        Click corner after corner of the part to survey denser, the first one again at the end. Escape leaves
        it.
      </p>
    );
  if (!ring || !present) return null;
  const able = vehicles.value.map(({ view }) => view).filter((v) => takesOrders(present, v));
  const send = async (event: SubmitEvent) => {
    event.preventDefault();
    const spacing_m = spacing.value.trim() === "" ? null : Number(spacing.value);
    fault.value = spacing_m !== null && !(spacing_m >= 0.5) ? "Type metres, 0.5 or more, or nothing" : "";
    if (fault.value === "" && (await surveyDenser(ring, spacing_m, who.value || null)))
      denserRing.value = null;
  };
  return (
    <form class="notice denser" onSubmit={(event) => void send(event)} data-testid="denser">
      <p>
        <b>Survey this part denser?</b> Its outline is{" "}
        {Math.round(lengthOf([...ring, ring[0] as (typeof ring)[0]]))} m long. The vehicle flies it after the
        legs that it has, then goes on with its part.
      </p>
      <label>
        Lines apart, m{" "}
        <input
          type="text"
          inputMode="decimal"
          size={5}
          placeholder="half"
          value={spacing.value}
          data-testid="denser-spacing"
          onInput={(event) => {
            spacing.value = event.currentTarget.value;
          }}
        />
      </label>
      <Choice
        label="Who flies it"
        value={who.value}
        options={[["", "Nearest vehicle"], ...able.map(({ name }) => [name, name] as const)]}
        id="denser-vehicle"
        onChoose={into(who)}
      />
      <button type="submit" class="command primary" data-testid="denser-send">
        Survey it
      </button>
      <Button onClick={sets(denserRing, null)}>Leave it</Button>
      {fault.value ? (
        <span class="fault" role="alert">
          ▲ {fault.value}
        </span>
      ) : null}
    </form>
  );
}
