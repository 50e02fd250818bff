/** Several areas of one plan, flown one after the other by the same team: blocks. Pure. */

import type { LngLat, NewMission, PlanView } from "../../api/types";
import { say } from "../../words/say";
import { allBlocks, type Block, cornersOf, type Draft, toMission } from "./draft";

/** Between a typed rectangle and the next one, as a share of its width. */
const GAP = 0.1;

export const blockTitle = ({ name }: Pick<Block, "name">, i: number): string =>
  name.trim() || say("blocks.block", { i: i + 1 });

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
  const next = { blocks: all, turn: all.length, block_name: "" };
  const lngs = cornersOf(draft).map(([lng]) => lng);
  if (draft.source === "drawn" || lngs.length === 0) return { ...next, source: "drawn", ring: [] };
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
  const all = allBlocks(draft);
  if (all.length === 1 || draft.kind === "search") return [toMission(draft)];
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
