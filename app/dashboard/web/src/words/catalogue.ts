/**
 * Every text of the page in every language, in files by what is told. `{name}` is filled in; `{n|one|many}` is the word that
 * suits the number `n`. What the service says (log, checklist, reasons, help of fields) comes in the service's words.
 */

import { FRAME } from "./frame";
import { IMPORTS } from "./imports";
import { MAP } from "./map";
import { NAMES } from "./names";
import { PLANNING } from "./planning";
import { REVIEW } from "./review";
import { WATCHING } from "./watching";

export const CATALOGUE = {
  ...FRAME,
  ...IMPORTS,
  ...MAP,
  ...NAMES,
  ...PLANNING,
  ...REVIEW,
  ...WATCHING,
} as const;
