/** A planner's settings as they are typed; which of them it reads is the service's to say. Pure. */

import SPEC from "../../api/mission.json";
import type { PlannerOptions, PlannerView } from "../../api/types";
import { say } from "../../words/say";
import type { Draft } from "./draft";
import { type Field, fieldFault, schemaOf, textOf, typedValue } from "./missionFields";

const BEFORE = "planner.options.";

/** The planner that flies lines as far apart as it is told. */
export const EVEN_LINES = "lawnmower";

/** The setting that every survey along lines is asked for: it stands beside the choice of the planner. */
export const LINE_HEADING = "line_heading_deg";

/** Whether the mission ends when lines at a distance that is given are flown. */
export const endsWithLines = ({ planner, spacing_m, options }: Draft): boolean =>
  planner === EVEN_LINES && (spacing_m.trim() || options.line_spacing_m?.trim() || "") !== "";

/** Whether lines across all others are flown in the end. */
export const fliesCrosslines = (draft: Draft): boolean => draft.planner === "swath" || endsWithLines(draft);

/** What settings are called, where their names are not enough. */
const LABELS: Readonly<Record<string, () => string>> = {
  [LINE_HEADING]: () => say("asked.courseOfTheLines"),
  line_spacing_m: () => say("asked.distanceOfTheLines"),
};

/** A setting as a field of the form; nothing for what is none, such as a trained controller, which is a whole document. */
export function optionField(name: string): Field | null {
  const path = `${BEFORE}${name}`;
  if (!(path in SPEC)) return null;
  const label = LABELS[name]?.() ?? name.replaceAll("_", " ");
  return { path: path as Field["path"], label, part: "planner", optional: true };
}

/** What a planner is set to otherwise than usual, as typed. */
export function optionTexts(options: PlannerOptions): Record<string, string> {
  return Object.fromEntries(
    Object.entries(options).flatMap(([name, value]) => {
      const field = optionField(name);
      return field && value != null && value !== schemaOf(field).default
        ? [[name, textOf(field, value)]]
        : [];
    }),
  );
}

/** The settings that a planner reads and the form has. */
export function optionsOf(planner: string, planners: readonly PlannerView[]): string[] {
  const read = planners.find(({ name }) => name === planner)?.options.properties ?? {};
  return Object.keys(read).filter((name) => optionField(name) !== null);
}

/** Another planner, with the settings that it reads, too: others it would refuse. */
export function withPlanner(
  planner: string,
  { options }: Pick<Draft, "options">,
  planners: readonly PlannerView[],
): Pick<Draft, "planner" | "options"> {
  const read = optionsOf(planner, planners);
  return {
    planner,
    options: Object.fromEntries(Object.entries(options).filter(([name]) => read.includes(name))),
  };
}

/** What is wrong with a typed setting; empty when nothing is. */
export function optionFault(name: string, text: string): string {
  const field = optionField(name);
  return field ? fieldFault(field, text) : "";
}

/** The settings to send: those that were typed, the distance of lines where the mission's length is said by it, and the trained controller with which a copied mission's planner flies. */
export function typedOptions({ planner, options, base, spacing_m }: Draft): PlannerOptions {
  const typed = Object.entries(options).flatMap(([name, text]) => {
    const field = optionField(name);
    const value = field && text.trim() !== "" ? typedValue(field, text) : null;
    return value == null ? [] : [[name, value]];
  });
  const model = base.planner?.name === planner ? base.planner.options?.model : null;
  const spaced = planner === EVEN_LINES && Number(spacing_m) > 0 ? { line_spacing_m: Number(spacing_m) } : {};
  return { ...Object.fromEntries(typed), ...spaced, ...(model ? { model } : {}) };
}

/**
 * How far a vehicle may fly for lines of so many metres over an area that is so many metres across. Even lines end the
 * mission when they are flown: ways between them, lines across, one line more than others have, and the way to the first
 * fit in, too.
 */
export const wayForLines = (
  { planner, crosslines_pct }: Pick<Draft, "planner" | "crosslines_pct">,
  lines_m: number,
  across_m: number,
): number =>
  planner === EVEN_LINES ? (1.15 + Number(crosslines_pct) / 100) * lines_m + 3 * across_m : lines_m;
