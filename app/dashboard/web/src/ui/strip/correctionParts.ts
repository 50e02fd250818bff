/** What the parts of the corrections share. */

import type { Signal } from "@preact/signals";
import type { CorrectionsView } from "../../api/types";
import { pointed } from "../../state/format";

/** Changes something, and shows the corrections that hold then. */
export type Change = (change: (id: string) => Promise<CorrectionsView>) => Promise<void>;

/** What each part is given. */
export interface PartProps {
  found: CorrectionsView;
  busy: Signal<boolean>;
  change: Change;
  fault: Signal<string>;
}

/** A number as it is typed; null where it is none. */
export const numberOf = (text: Signal<string>): number | null => {
  const typed = pointed(text.peek()).trim();
  return typed !== "" && Number.isFinite(Number(typed)) ? Number(typed) : null;
};
