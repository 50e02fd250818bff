/** A planner's settings as they are typed; which of them it reads is the service's to say. Pure. */

import SPEC from "../../api/mission.json";
import type { PlannerOptions, PlannerView, SurveyLine } from "../../api/types";
import { say } from "../../words/say";
import type { Draft } from "./draft";
import { type Field, fieldFault, schemaOf, textOf, typedValue } from "./missionFields";

const BEFORE = "planner.options.";

/** The planner that flies lines as far apart as it is told. */
export const EVEN_LINES = "lawnmower";

/** The setting that every survey along lines is asked for: it stands beside the choice of the planner. */
export const LINE_HEADING = "line_heading_deg";

/** The lines of a plan that are flown: other planners fly where they find best. */
export const linesOf = ({ kind, planner, lines }: Draft): readonly SurveyLine[] =>
  kind === "survey" && planner === EVEN_LINES ? lines : [];

/** The setting that lines of a plan are flown in its order. */
const KEEP_ORDER = "keep_line_order";

/** Whether the mission is as long as the lines of its plan take. */
export const lastsForLines = (draft: Draft): boolean => draft.until_lines && linesOf(draft).length > 0;

/** Whether the mission ends when lines are flown that are given, or whose distance is. */
export const endsWithLines = (draft: Draft): boolean => linesOf(draft).length > 0 || isSpaced(draft);

const isSpaced = ({ planner, spacing_m, options }: Draft): boolean =>
  planner === EVEN_LINES && (spacing_m.trim() || options.line_spacing_m?.trim() || "") !== "";

/** Whether lines across all others are flown in the end; a plan has its own. */
export const fliesCrosslines = (draft: Draft): boolean =>
  draft.planner === "swath" || (linesOf(draft).length === 0 && isSpaced(draft));

/** Settings that say where lines lie, which the lines of a plan say themselves. */
const LINES_LIE: readonly string[] = [LINE_HEADING, "line_spacing_m"];

/** What settings are called, where their names are not enough. */
const LABELS: Readonly<Record<string, () => string>> = {
  [LINE_HEADING]: () => say("asked.courseOfTheLines"),
  [KEEP_ORDER]: () => say("lines.inOrder"),
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

/** The settings that the form shows for a draft. */
export const shownOptions = (draft: Draft, planners: readonly PlannerView[]): string[] =>
  optionsOf(draft.planner, planners).filter((name) =>
    name === KEEP_ORDER
      ? linesOf(draft).length > 0
      : linesOf(draft).length === 0 || !LINES_LIE.includes(name),
  );

/** Those of them that do not stand beside the choice of the planner, or the lines of a plan. */
export const expertOptions = (draft: Draft, planners: readonly PlannerView[]): string[] =>
  shownOptions(draft, planners).filter((name) => name !== LINE_HEADING && name !== KEEP_ORDER);

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
export function typedOptions(draft: Draft): PlannerOptions {
  const { planner, options, base, spacing_m } = draft;
  const isPlanned = linesOf(draft).length > 0;
  const typed = Object.entries(options).flatMap(([name, text]) => {
    if (isPlanned && LINES_LIE.includes(name)) return [];
    const field = optionField(name);
    const value = field && text.trim() !== "" ? typedValue(field, text) : null;
    return value == null ? [] : [[name, value]];
  });
  const model = base.planner?.name === planner ? base.planner.options?.model : null;
  const spaced =
    planner === EVEN_LINES && !isPlanned && Number(spacing_m) > 0
      ? { line_spacing_m: Number(spacing_m) }
      : {};
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
