/** A mission's description as one file, and as a template for others. Pure. */

import SPEC from "../../api/mission.json";
import type { MissionView, NewMission } from "../../api/types";
import { say } from "../../words/say";
import { copyOf, type Draft } from "./draft";

const FORMAT = "bathyfleet mission";

/** What the file holds: what the service takes, and the tide table that it is told later. */
interface MissionFile {
  format: typeof FORMAT;
  mission: NewMission;
  tide_table?: string;
}

export function missionFile(described: NewMission & { steps?: unknown }, tide_table = ""): string {
  // As shown by the service it has its steps, which follow from its budget; sites are known to this service alone.
  const { steps: _, site: _site, ...mission } = described;
  const file: MissionFile = { format: FORMAT, mission, ...(tide_table ? { tide_table } : {}) };
  return `${JSON.stringify(file, null, 2)}\n`;
}

/** A name for the file that every system takes. */
export const fileNameOf = (name: string): string =>
  `${name.trim().replaceAll(/[^\p{L}\p{N}._-]+/gu, "-") || "mission"}.mission.json`;

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
  if (!mission?.name || !Array.isArray(ring) || ring.length < 4) {
    throw new Error(say("missionFile.holdsNoMissionItNeedsA", { fileName }));
  }
  const draft = draftOf(mission);
  return content.tide_table ? { ...draft, tide_table: content.tide_table } : draft;
}

/** The draft that a description gives, whose defaults are not said. */
export function draftOf(mission: NewMission & { steps?: number }): Draft {
  const { planner, budget, steps } = mission;
  const whole = {
    ...mission,
    kind: mission.kind ?? SPEC.kind.default,
    keep_out: mission.keep_out ?? [],
    vehicles: mission.vehicles ?? [],
    search: mission.search ?? null,
    recovery: mission.recovery ?? null,
    tide: mission.tide ?? {},
    planner: { name: planner?.name ?? SPEC["planner.name"].default, options: planner?.options ?? {} },
    budget: budget ?? { steps: steps ?? SPEC["budget.steps"].default },
  };
  const shown = { name: mission.name, spec: whole } as unknown as Pick<MissionView, "name" | "spec">;
  return { ...copyOf(shown), name: mission.name };
}

/** What a template says of a mission elsewhere: everything but its name and its places. */
export function withTemplate(template: NewMission, draft: Draft): Draft {
  const { name, site, source, ring, keepOut, latitude, longitude, east_m, north_m, goal, entry, recovery } =
    draft;
  const { own, ...settings } = draftOf(template);
  const placeless = Object.entries(own).map(([vehicle, { recovery_point: _, ...rest }]) => [vehicle, rest]);
  return {
    ...settings,
    own: Object.fromEntries(placeless),
    obstacles: [],
    ...{ name, site, source, ring, keepOut, latitude, longitude, east_m, north_m, goal, entry, recovery },
  };
}

export interface Template {
  name: string;
  mission: NewMission;
}
