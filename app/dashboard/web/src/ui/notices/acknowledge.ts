/** Acknowledges alarms; what went wrong is shown beside them. */

import { signal } from "@preact/signals";
import { api } from "../../api/client";
import { said } from "../../state/session";
import { openAlarms } from "../../state/store";

export const takeFault = signal("");

/** Acknowledges some alarms. */
export async function take(ids: readonly string[]): Promise<void> {
  try {
    await Promise.all(ids.map((id) => api.acknowledge(id)));
    takeFault.value = "";
  } catch (error) {
    takeFault.value = said(error);
  }
}

/** Acknowledges every open alarm. */
export const takeAlarms = () => take(openAlarms.value.map(({ id }) => id));
