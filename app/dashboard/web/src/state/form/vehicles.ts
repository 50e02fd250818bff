/** Changes of a draft's vehicles. Pure. */

import { type Draft, simulatedNames, vehicleNames } from "./draft";

/** The vehicle at this place is called otherwise and keeps what it has of its own; for a name that another one has it waits. */
export function withVehicleCalled(draft: Draft, place: number, name: string): Partial<Draft> {
  const names = vehicleNames(draft);
  const before = names[place] ?? "";
  const others = names.filter((_, i) => i !== place);
  const { [before]: _, ...waiting } = draft.wanted;
  if (name === before) return { wanted: waiting };
  if (others.includes(name)) return { wanted: { ...waiting, [before]: name } };
  const its = draft.own[before];
  const kept = Object.entries(draft.own).filter(
    ([one]) => one !== name && (one !== before || others.includes(before)),
  );
  const simulated = place - draft.chosen.length;
  const change: Partial<Draft> = {
    own: { ...Object.fromEntries(kept), ...(its ? { [name]: its } : {}) },
    wanted: waiting,
    ...(simulated < 0
      ? { chosen: draft.chosen.map((vehicle, i) => (i === place ? { ...vehicle, name } : vehicle)) }
      : { names: simulatedNames(draft).with(simulated, name).join(", ") }),
  };
  const next = names.findIndex((one) => waiting[one] === before);
  return next < 0 ? change : { ...change, ...withVehicleCalled({ ...draft, ...change }, next, before) };
}
