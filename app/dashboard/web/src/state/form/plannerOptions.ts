/** A planner's settings as they are typed; which of them it reads is the service's to say. Pure. */

import SPEC from "../../api/mission.json";
import type { PlannerOptions, PlannerView } from "../../api/types";
import type { Draft } from "./draft";
import { type Field, fieldFault, schemaOf, textOf, typedValue } from "./missionFields";

const BEFORE = "planner.options.";

/** A setting as a field of the form; nothing for what is none, such as a trained controller, which is a whole document. */
export function optionField(name: string): Field | null {
  const path = `${BEFORE}${name}`;
  if (!(path in SPEC)) return null;
  return { path: path as Field["path"], label: name.replaceAll("_", " "), part: "planner", optional: true };
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

/** The settings to send: those that were typed, and the trained controller with which a copied mission's planner flies. */
export function typedOptions({ planner, options, base }: Draft): PlannerOptions {
  const typed = Object.entries(options).flatMap(([name, text]) => {
    const field = optionField(name);
    const value = field && text.trim() !== "" ? typedValue(field, text) : null;
    return value == null ? [] : [[name, value]];
  });
  const model = base.planner?.name === planner ? base.planner.options?.model : null;
  return { ...Object.fromEntries(typed), ...(model ? { model } : {}) };
}
