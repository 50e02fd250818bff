/** Takes the place where the own ship is at this moment. */

import { signal, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { api } from "../api/client";
import type { LngLat } from "../api/types";
import { minutes } from "../map/marks/ships";
import { said } from "../state/session";
import { say } from "../words/say";
import { Button } from "./parts/Controls";

/** Whether a receiver is set up; null while nobody asked. */
const listens = signal<boolean | null>(null);

async function look(): Promise<void> {
  if (listens.peek() !== null) return;
  listens.value = false;
  try {
    listens.value = (await api.traffic()).sources.length > 0;
  } catch {
    // The service is gone, which the page tells of.
    listens.value = null;
  }
}

/** Nothing where no receiver is set up; what is not known right now is told, and not taken. */
export function OwnShip({ id, onPlace }: { id: string; onPlace: (at: LngLat) => void }) {
  const fault = useSignal("");
  useEffect(() => void look(), []);
  const take = async () => {
    try {
      const { own_ship: ship } = await api.traffic();
      fault.value = ship
        ? ship.current
          ? ""
          : say("ships.ownShipWas", { age: minutes(ship.age_s) })
        : say("ships.ownShipUnknown");
      if (ship?.current) onPlace([ship.lon_deg, ship.lat_deg]);
    } catch (error) {
      fault.value = said(error);
    }
  };
  if (!listens.value) return null;
  return (
    <>
      <Button id={`own-ship-${id}`} title={say("ships.takeOwnShip")} onClick={() => void take()}>
        {say("ships.ownShip")}
      </Button>
      {fault.value ? (
        <span class="fault" role="alert" data-testid={`own-ship-fault-${id}`}>
          ▲ {fault.value}
        </span>
      ) : null}
    </>
  );
}
