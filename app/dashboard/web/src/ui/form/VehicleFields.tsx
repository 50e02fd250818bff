import { useSignal } from "@preact/signals";
import type { Sensor, VehicleSpec, VehicleView } from "../../api/types";
import { type Own, ownKey, sensorOf, simulatedNames, vehicleNames } from "../../state/form/draft";
import { SENSORS, schemaOf, vehicleFieldsOf } from "../../state/form/missionFields";
import { withVehicleCalled } from "../../state/form/vehicles";
import { pointed } from "../../state/format";
import { batteryWords, vehicleState } from "../../state/stateNames";
import { fleet } from "../../state/store";
import { named, say } from "../../words/say";
import { Button, Choice } from "../parts/Controls";
import { Fault, Place, Text, useForm } from "./Fields";

const sensorWords = () => SENSORS.map((sensor) => [sensor, named("sensor", sensor, sensor)] as const);

/** Who takes part: real vehicles that are free, simulated ones, and what each has of its own. */
export function VehicleFields() {
  const { draft, set } = useForm();
  return (
    <fieldset>
      <legend>{say("compare.vehicles")}</legend>
      <FleetChoice />
      <div class="pair">
        <Text field="simulated" label={say("vehicles.simulatedVehicles")} numeric />
        <label class="field">
          {say("vehicles.theirSensor")}
          <Choice
            value={draft.sensor}
            options={sensorWords()}
            id="field-sensor"
            onChoose={(sensor) => set({ sensor })}
          />
        </label>
      </div>
      <SimulatedNames />
      <Singles />
    </fieldset>
  );
}

/** Each simulated vehicle's name, to be changed. */
function SimulatedNames() {
  const { draft } = useForm();
  return (
    <div class="pair names">
      {simulatedNames(draft).map((_, i) => (
        // The place in the list is what stays while a name is typed.
        <VehicleName
          key={i}
          place={draft.chosen.length + i}
          id={`sim-name-${i + 1}`}
          label={say("vehicles.nameOfSimulatedVehicle", { i: i + 1 })}
        />
      ))}
      <Fault field="names" />
    </div>
  );
}

/** What the vehicle at this place is called; it is called otherwise when the whole name was typed. */
function VehicleName({ place, id, label }: { place: number; id: string; label: string }) {
  const { draft, set } = useForm();
  const names = vehicleNames(draft);
  const name = names[place] ?? "";
  const asked = draft.wanted[name];
  // A name that waits is shown while another vehicle has it; after that, what is sent is shown again.
  const shown = asked && names.some((other, i) => i !== place && other === asked) ? asked : name;
  // What is being typed stays whatever is drawn anew meanwhile.
  const typing = useSignal<string | null>(null);
  return (
    <input
      type="text"
      autocomplete="off"
      aria-label={label}
      aria-invalid={shown === name ? "false" : "true"}
      value={typing.value ?? shown}
      data-testid={id}
      onInput={({ currentTarget }) => {
        typing.value = currentTarget.value;
      }}
      onChange={({ currentTarget }) => {
        const typed = currentTarget.value.replaceAll(",", " ").trim();
        typing.value = null;
        if (typed) set((now) => withVehicleCalled(now, place, typed));
      }}
      onBlur={() => {
        typing.value = null;
      }}
    />
  );
}

/** What single vehicles have of their own: another speed or sensor, how long their energy lasts, where they come home to. */
function Singles() {
  const { draft, faults, set } = useForm();
  const names = vehicleNames(draft);
  if (names.length === 0) return null;
  const change = (name: string, field: keyof Own, text: string | Sensor) =>
    set(({ own }) => ({ own: { ...own, [name]: { ...own[name], [field]: text } } }));
  return (
    <details>
      <summary>{say("vehicles.singleVehiclesSpeedEndurance")}</summary>
      {names.map((name) => (
        <fieldset key={name} class="single-vehicle">
          <legend>{name}</legend>
          <div class="pair">
            <label class="field">
              {say("vehicles.sensor")}
              <Choice
                value={sensorOf(draft, name)}
                options={sensorWords()}
                id={`sensor-${name}`}
                onChoose={(sensor) => change(name, "sensor", sensor)}
              />
            </label>
            {vehicleFieldsOf(draft.kind, sensorOf(draft, name)).map(([field, { path, label, unit }]) => (
              <label key={field} class="field" title={schemaOf({ path }).description}>
                {unit ? `${label}, ${unit}` : label}
                <input
                  type="text"
                  inputMode="decimal"
                  autocomplete="off"
                  value={draft.own[name]?.[field] ?? ""}
                  placeholder={
                    field === "speed_mps"
                      ? draft.speed_mps
                      : String(
                          schemaOf({ path }).default ??
                            (field === "altitude_m" ? say("vehicles.keepsItsDepth") : say("asked.notKnown")),
                        )
                  }
                  aria-invalid={faults[ownKey(name, field)] ? "true" : "false"}
                  data-testid={`${field}-${name}`}
                  onInput={(event) => change(name, field, pointed(event.currentTarget.value))}
                />
                <Fault field={ownKey(name, field)} />
              </label>
            ))}
          </div>
          <Place
            id={`recovery_point-${name}`}
            label={say("vehicles.itsOwnRecoveryPoint")}
            placeholder={say("vehicles.theMissionS")}
            text={draft.own[name]?.recovery_point ?? ""}
            onText={(text) => change(name, "recovery_point", text)}
            invalid={faults[ownKey(name, "recovery_point")] !== undefined}
          >
            <Fault field={ownKey(name, "recovery_point")} />
          </Place>
        </fieldset>
      ))}
    </details>
  );
}

/** Real vehicles that the service hears and that are free. */
function FleetChoice() {
  const { draft, set } = useForm();
  const free = fleet.value.filter((v) => v.mission_id === null && v.kind !== "sim");
  const chosen = new Set(draft.chosen.map((v) => v.name));
  // Of a copy: as they are described there, heard or not.
  const described = draft.chosen.filter((spec) => !free.some((v) => v.name === spec.name));
  if (free.length === 0 && described.length === 0) {
    return <p class="empty">{say("vehicles.noRealVehicleIsHeardSwitch")}</p>;
  }
  const toggle = (vehicle: VehicleView, on: boolean) =>
    set({
      chosen: on ? [...draft.chosen, asSpec(vehicle)] : draft.chosen.filter((v) => v.name !== vehicle.name),
    });
  return (
    <>
      {described.map((spec) => (
        <Described key={draft.chosen.indexOf(spec)} spec={spec} />
      ))}
      {free.map((v) => (
        <label key={v.name} class="check">
          <input
            type="checkbox"
            checked={chosen.has(v.name)}
            onChange={(event) => toggle(v, event.currentTarget.checked)}
          />
          <span>
            {v.name}{" "}
            <small>
              {[
                v.kind === "imc" ? "IMC" : v.kind,
                vehicleState(v, undefined).words,
                v.battery_pct === null ? null : say("vehicles.battery", { v: batteryWords(v) }),
              ]
                .filter((part) => part !== null)
                .join(" · ")}
            </small>
          </span>
        </label>
      ))}
    </>
  );
}

/** A vehicle of the mission that is copied: it can be called otherwise, or left out. */
function Described({ spec }: { spec: VehicleSpec }) {
  const { draft, set } = useForm();
  return (
    <div class="chosen-vehicle field">
      <VehicleName
        place={draft.chosen.indexOf(spec)}
        id={`vehicle-${spec.name}`}
        label={say("vehicles.nameOf", { spec: spec.name })}
      />
      <small>{spec.kind === "imc" ? "IMC" : spec.kind}</small>
      <Button
        kind="tool small"
        aria-label={say("vehicles.leaveOut", { spec: spec.name })}
        onClick={() => set(({ chosen }) => ({ chosen: chosen.filter((one) => one !== spec) }))}
      >
        ✕
      </Button>
    </div>
  );
}

function asSpec(vehicle: VehicleView): VehicleSpec {
  return { name: vehicle.name, kind: vehicle.kind, sensor: vehicle.sensor ?? "single_beam" };
}
