import "./VehicleOrders.css";
import { useSignal, useSignalEffect } from "@preact/signals";
import type { VehicleView } from "../../api/types";
import { placeOf, placeSample } from "../../state/coordinates";
import { distance } from "../../state/format";
import {
  denserRing,
  goVehicle,
  pickPlaceFor,
  repeatLine,
  skipLine,
  surveyDenser,
  typingFor,
} from "../../state/orders/orders";
import { lengthOf, orderWords, spacingOf, takesOrders } from "../../state/orders/orderWords";
import { resumeVehicle } from "../../state/session";
import { describing, drawing, drawingReady, mission, picking, vehicles } from "../../state/store";
import { say } from "../../words/say";
import { Button, Choice, into, sets, Typed, useEscape } from "../parts/Controls";

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
        title={say("orders.endIt")}
        onClick={() => void resumeVehicle(v.name)}
      >
        {say("orders.goOn")}
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
        title={say("orders.sendItTo")}
        onClick={() => {
          typingFor.value = typing ? null : v.name;
          if (typing) picking.value = null;
          else pickPlaceFor(v.name);
        }}
      >
        {say("orders.goThere")}
      </Button>
      <Button
        id={`skip-${v.name}`}
        commands
        title={say("orders.leaveOut")}
        onClick={() => void skipLine(v.name)}
      >
        {say("orders.skip")}
      </Button>
      <Button
        id={`repeat-${v.name}`}
        commands
        title={say("orders.flyAgain")}
        onClick={() => void repeatLine(v.name)}
      >
        {say("orders.again")}
      </Button>
    </>
  );
}

/** Where a vehicle is to go, typed; the map takes a click meanwhile. */
export function TypedPlace({ name }: { name: string }) {
  const text = useSignal("");
  const fault = useSignal("");
  useEscape(typingFor, null);
  useEscape(picking, null);
  useSignalEffect(() => {
    // The click on the map came.
    if (!picking.value) typingFor.value = null;
  });
  const go = async (event: SubmitEvent) => {
    event.preventDefault();
    const at = placeOf(text.value);
    fault.value = at ? "" : say("orders.typeAPosition", { sample: placeSample() });
    if (at && (await goVehicle(name, at))) {
      typingFor.value = null;
      picking.value = null;
    }
  };
  return (
    <form class="typed-place" onSubmit={(event) => void go(event)}>
      <Typed
        text={text}
        label={say("orders.whereGoes", { name })}
        placeholder={say("orders.clickOrType")}
        id={`go-place-${name}`}
      />
      <button type="submit" class="command" data-testid={`go-send-${name}`}>
        {say("orders.send")}
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
  useEscape(denserRing, null);
  useEscape(drawing, null);
  const present = mission.value;
  if (drawing.value && drawingReady.value && !describing.value && present)
    return (
      <p class="notice" role="status" data-testid="draws-denser">
        {say("orders.clickCorners")}
      </p>
    );
  if (!ring || !present) return null;
  const able = vehicles.value.map(({ view }) => view).filter((v) => takesOrders(present, v));
  const send = async (event: SubmitEvent) => {
    event.preventDefault();
    const spacing_m = spacingOf(spacing.value);
    fault.value = spacing_m === undefined ? say("orders.typeMetres") : "";
    if (spacing_m !== undefined && (await surveyDenser(ring, spacing_m, who.value || null)))
      denserRing.value = null;
  };
  return (
    <form class="notice denser" onSubmit={(event) => void send(event)} data-testid="denser">
      <p>
        <b>{say("orders.denserQuestion")}</b>{" "}
        {say("orders.denserHint", { length: distance(lengthOf([...ring, ring[0] as (typeof ring)[0]])) })}
      </p>
      <label>
        {say("orders.linesApart")}{" "}
        <input
          type="text"
          inputMode="decimal"
          size={5}
          placeholder={say("orders.half")}
          value={spacing.value}
          data-testid="denser-spacing"
          onInput={(event) => {
            spacing.value = event.currentTarget.value;
          }}
        />
      </label>
      <Choice
        label={say("orders.whoFliesIt")}
        value={who.value}
        options={[["", say("orders.nearest")], ...able.map(({ name }) => [name, name] as const)]}
        id="denser-vehicle"
        onChoose={into(who)}
      />
      <button type="submit" class="command primary" data-testid="denser-send">
        {say("orders.surveyIt")}
      </button>
      <Button onClick={sets(denserRing, null)}>{say("orders.leaveIt")}</Button>
      {fault.value ? (
        <span class="fault" role="alert">
          ▲ {fault.value}
        </span>
      ) : null}
    </form>
  );
}
