/** A mission's description as one file, and as a template for others. Pure. */

import SPEC from "../../api/mission.json";
import type { LngLat, MissionView, NewMission, PolygonGeometry } from "../../api/types";
import { inDegrees, polygonOf, ringOf } from "../../map/area";
import { say } from "../../words/say";
import { allBlocks, type Block, type Draft, draftFrom, withoutDaysWater } from "./draft";

const FORMAT = "bathyfleet mission";

/** What the file holds: what the service takes, and the tide table that it is told later. */
interface MissionFile {
  format: typeof FORMAT;
  mission: NewMission;
  tide_table?: string;
  /** How far apart lines are to be, where the length is given by that. */
  spacing_m?: number;
  /** Where there are several areas: all of them in their order. */
  blocks?: readonly { name: string; area: PolygonGeometry }[];
}

export function missionFile(
  described: NewMission & { steps?: unknown },
  tide_table = "",
  blocks: readonly Block[] = [],
  spacing_m = "",
): string {
  // As shown by the service it has its steps, which follow from its budget; sites and missions are known to it alone.
  const { steps: _, site: _site, after: _after, ...mission } = described;
  const file: MissionFile = {
    format: FORMAT,
    mission,
    ...(tide_table ? { tide_table } : {}),
    ...(spacing_m ? { spacing_m: Number(spacing_m) } : {}),
    ...(blocks.length > 1
      ? { blocks: blocks.map(({ name, ring }) => ({ name, area: polygonOf(ring) })) }
      : {}),
  };
  return `${JSON.stringify(file, null, 2)}\n`;
}

/** A name for a file that every system takes, without its ending. */
export const plainFileName = (name: string): string =>
  name.trim().replaceAll(/[^\p{L}\p{N}._-]+/gu, "-") || "mission";

export const fileNameOf = (name: string): string => `${plainFileName(name)}.mission.json`;

/** The draft that a file describes. Throws what is wrong with it. */
export function draftIn(fileName: string, text: string): Draft {
  let content: Partial<MissionFile> & Partial<NewMission>;
  try {
    content = JSON.parse(text);
  } catch {
    throw new Error(say("missionFile.isNoJsonAMissionS", { fileName }));
  }
  // What was posted to the service by hand is as good.
  const mission = content?.format === FORMAT ? content.mission : (content as NewMission);
  const ring = mission?.area?.coordinates?.[0];
  if (!mission?.name || typeof mission.name !== "string" || !Array.isArray(ring) || ring.length < 4) {
    throw new Error(say("missionFile.holdsNoMissionItNeedsA", { fileName }));
  }
  try {
    const [first, ...blocks] = (content.blocks ?? []).map(({ name, area }) => ({
      name: String(name ?? ""),
      ring: ringOf(area),
    }));
    const draft: Draft = {
      ...draftOf(mission),
      ...(content.tide_table ? { tide_table: content.tide_table } : {}),
      ...(content.spacing_m ? { spacing_m: String(content.spacing_m) } : {}),
      ...(first ? { ring: first.ring, block_name: first.name, blocks } : {}),
    };
    inDegrees(fileName, [
      ...allBlocks(draft).map((block) => block.ring),
      ...draft.keepOut,
      ...draft.obstacles,
      ...draft.lines.map(({ coordinates }) => coordinates as LngLat[]),
    ]);
    return draft;
  } catch (error) {
    // It stumbled over what is not as it has to be.
    if (!(error instanceof TypeError)) throw error;
    throw new Error(say("missionFile.isBroken", { fileName }));
  }
}

/** The draft that a description gives, whose defaults are not said. */
export function draftOf(mission: NewMission & { steps?: number }): Draft {
  const { planner, budget, steps } = mission;
  const whole = {
    ...mission,
    kind: mission.kind ?? SPEC.kind.default,
    keep_out: mission.keep_out ?? [],
    survey_lines: mission.survey_lines ?? [],
    vehicles: mission.vehicles ?? [],
    search: mission.search ?? null,
    recovery: mission.recovery ?? null,
    tide: mission.tide ?? {},
    planner: { name: planner?.name ?? SPEC["planner.name"].default, options: planner?.options ?? {} },
    budget: budget ?? { steps: steps ?? SPEC["budget.steps"].default },
  };
  const shown = { name: mission.name, spec: whole } as unknown as Pick<MissionView, "name" | "spec">;
  return draftFrom(shown);
}

/** What a template says of a mission elsewhere: everything but its name, its places, and the day's casts and water levels. */
export function withTemplate({ mission, spacing_m = "" }: Omit<Template, "name">, draft: Draft): Draft {
  const { name, site, source, ring, keepOut, latitude, longitude, east_m, north_m, goal, entry, recovery } =
    draft;
  const { lines, until_lines, blocks, turn, block_name, floor_depth_m, tide_m, tide_source, tide_table } =
    draft;
  const { own, base, ...settings } = draftOf(mission);
  const placeless = Object.entries(own).map(([vehicle, { recovery_point: _, ...rest }]) => [vehicle, rest]);
  return {
    ...settings,
    own: Object.fromEntries(placeless),
    base: withoutDaysWater(base),
    spacing_m,
    obstacles: [],
    ...{ name, site, source, ring, keepOut, latitude, longitude, east_m, north_m, goal, entry, recovery },
    ...{ lines, until_lines, blocks, turn, block_name, floor_depth_m, tide_m, tide_source, tide_table },
  };
}

export interface Template {
  name: string;
  mission: NewMission;
  /** How far apart lines are to be, where the length is given by that. */
  spacing_m?: string;
}
