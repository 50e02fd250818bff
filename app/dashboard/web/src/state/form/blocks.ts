/** Several areas of one plan, flown one after the other by the same team: blocks. Pure. */

import type { ForecastView, LngLat, NewMission, PlanView } from "../../api/types";
import {
  allBlocks,
  type Block,
  blockTitle,
  cornersOf,
  type Draft,
  type FaultKey,
  ofBlock,
  toMission,
} from "./draft";

/** Between a typed rectangle and the next one, as a share of its width. */
const GAP = 0.1;

/** The areas that are flown: a search has one. */
export const flownBlocks = (draft: Draft): Block[] =>
  allBlocks(draft).filter((_, i) => draft.kind === "survey" || i === draft.turn);

/** The draft's blocks in another order or number, and which of them is described by the form's fields. */
const arranged = (all: readonly Block[], turn: number): Partial<Draft> => ({
  blocks: all.filter((_, i) => i !== turn),
  turn,
});

/** The form's fields describe another block; what they described is kept. */
export function atBlock(draft: Draft, turn: number): Partial<Draft> {
  const all = allBlocks(draft);
  const block = all[turn];
  if (!block || turn === draft.turn) return {};
  return { ...arranged(all, turn), source: "drawn", ring: block.ring, block_name: block.name };
}

/** One block more, which is to be drawn; typed, it begins beside the last one. */
export function withAnother(draft: Draft): Partial<Draft> {
  const all = allBlocks(draft);
  const next = { blocks: all, turn: all.length, block_name: "", ring: [] };
  const lngs = cornersOf(draft).map(([lng]) => lng);
  if (draft.source === "drawn" || lngs.length === 0) return { ...next, source: "drawn" };
  const [west, east] = [Math.min(...lngs), Math.max(...lngs)];
  return { ...next, longitude: (east + GAP * (east - west)).toFixed(6) };
}

/** Areas that a file brings are further blocks. */
export function withAreas(draft: Draft, rings: readonly (readonly LngLat[])[]): Partial<Draft> {
  return { blocks: [...draft.blocks, ...rings.map((ring) => ({ name: "", ring }))] };
}

export function withoutBlock(draft: Draft, i: number): Partial<Draft> {
  const all = allBlocks(draft);
  const rest = all.filter((_, k) => k !== i);
  if (i !== draft.turn) return arranged(rest, draft.turn - (i < draft.turn ? 1 : 0));
  const turn = Math.min(i, rest.length - 1);
  const { ring, name } = rest[turn] as Block;
  return { ...arranged(rest, turn), source: "drawn", ring, block_name: name };
}

/** A block is flown one earlier. */
export function earlier(draft: Draft, i: number): Partial<Draft> {
  const all = allBlocks(draft);
  const [before, moved] = [all[i - 1], all[i]] as [Block, Block];
  const turn = draft.turn === i ? i - 1 : draft.turn === i - 1 ? i : draft.turn;
  return arranged([...all.slice(0, i - 1), moved, before, ...all.slice(i + 1)], turn);
}

export function renamed(draft: Draft, i: number, name: string): Partial<Draft> {
  if (i === draft.turn) return { block_name: name };
  return arranged(
    allBlocks(draft).map((block, k) => (k === i ? { ...block, name } : block)),
    draft.turn,
  );
}

/** What to send for each block of a draft without faults, in their order; only at the last one's end vehicles go home. */
export function toMissions(draft: Draft): NewMission[] {
  const all = flownBlocks(draft);
  if (all.length === 1) return [toMission(draft)];
  return all.map((block, i) => {
    const one = i === draft.turn ? draft : { ...draft, source: "drawn" as const, ring: block.ring };
    const made = toMission(one);
    const stays = made.recovery && i < all.length - 1;
    return {
      ...made,
      name: `${made.name} – ${blockTitle(block, i)}`,
      ...(stays ? { recovery: { ...made.recovery, on_finish: "stop" } } : {}),
    } as NewMission;
  });
}

/** Where a fault belongs that the service finds in the `i`-th block; one of its area is told of beside the marked one alone. */
export function faultInBlock(field: FaultKey, fault: string, draft: Draft, i: number): [FaultKey, string] {
  const blocks = flownBlocks(draft);
  const block = blocks[i];
  const isAnother = field === "ring" && blocks.length > 1 && i !== draft.turn;
  return isAnother && block ? ["blocks", ofBlock(block, i, fault)] : [field, fault];
}

/** A block as its plan is asked for: its vehicles come from where they end the one before. */
export function comingFrom(before: PlanView | undefined, mission: NewMission): NewMission {
  if (!before) return mission;
  const ends = new Map(before.vehicles.map(({ vehicle, way }) => [vehicle, way.at(-1)]));
  return {
    ...mission,
    after: "planned",
    vehicles: mission.vehicles.map((vehicle) => {
      const start = ends.get(vehicle.name);
      return start ? { ...vehicle, start } : vehicle;
    }),
  };
}

export type PlannedVehicle = PlanView["vehicles"][number];

/** Plans of blocks that are flown one after the other on one battery: what was used before is not left any more. */
export function inSequence(plans: readonly PlanView[]): PlanView[] {
  const used_s = new Map<string, number>();
  const homeBefore_s = new Map<string, number>();
  return plans.map((plan) => ({
    ...plan,
    vehicles: plan.vehicles.map((v) => {
      const left_s = v.energy_left_s === null ? null : v.energy_left_s - (used_s.get(v.vehicle) ?? 0);
      used_s.set(v.vehicle, (used_s.get(v.vehicle) ?? 0) + v.duration_s);
      const home_s = v.energy_needs_s - v.duration_s;
      const most_s = Math.max(home_s, homeBefore_s.get(v.vehicle) ?? 0);
      homeBefore_s.set(v.vehicle, home_s);
      if (left_s === v.energy_left_s || left_s === null) return v;
      // Its plan knew nothing of what was used before: where it turns back is about where this lasts for the way home.
      const share = Math.min(Math.max((left_s - most_s) / v.duration_s, 0), 1);
      const turn_back_m = v.energy_needs_s > left_s ? share * v.distance_m : null;
      return { ...v, energy_left_s: left_s, turn_back_m };
    }),
  }));
}

export function total<T>(all: readonly T[], of: (one: T) => number): number {
  return all.reduce((sum, one) => sum + of(one), 0);
}

/** What a vehicle does in all blocks, of its parts as `inSequence` gives them: home it goes from the last one. */
export function inAll(parts: readonly PlannedVehicle[]): PlannedVehicle | undefined {
  const [first, last] = [parts[0], parts.at(-1)];
  if (!first || !last) return undefined;
  const before = (i: number, of: (part: PlannedVehicle) => number) => total(parts.slice(0, i), of);
  const turn = parts.findIndex(({ turn_back_m }) => turn_back_m !== null);
  return {
    ...last,
    distance_m: total(parts, (part) => part.distance_m),
    duration_s: total(parts, (part) => part.duration_s),
    duration_s_range: {
      low: total(parts, (part) => part.duration_s_range.low),
      high: total(parts, (part) => part.duration_s_range.high),
    },
    energy_left_s: first.energy_left_s,
    energy_needs_s: Math.max(
      ...parts.map((part, i) => before(i, ({ duration_s }) => duration_s) + part.energy_needs_s),
    ),
    turn_back_m:
      turn < 0 ? null : before(turn, ({ distance_m }) => distance_m) + (parts[turn]?.turn_back_m ?? 0),
  };
}

/** What is to be expected of several blocks: sums, as soon as each was simulated. */
export function forecastInAll(found: readonly ForecastView[]) {
  return {
    duration_s_range: {
      low: total(found, (view) => view.duration_s_range.low),
      high: total(found, (view) => view.duration_s_range.high),
    },
    vehicles: (found[0]?.vehicles ?? []).map(({ vehicle }) => {
      const ways = found.flatMap((view) => view.vehicles.filter((one) => one.vehicle === vehicle));
      return {
        vehicle,
        distance_m_range: {
          low: total(ways, (way) => way.distance_m_range.low),
          high: total(ways, (way) => way.distance_m_range.high),
        },
      };
    }),
  };
}
