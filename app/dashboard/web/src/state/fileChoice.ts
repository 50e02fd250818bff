/** What is asked of files that are downloaded: once for all that take it. */

import type { ProductView } from "../api/types";
import { kept } from "../persistentSignal";

export type FileOption = ProductView["options"][number];

/** What was chosen, by the name of the service's parameter; empty: what the service takes by itself. */
export type FileChoice = Readonly<Partial<Record<FileOption, string>>>;

/** Chosen for all files, on this device. */
export const fileChoice = kept<FileChoice>("file-choice", {});

/** Whether one of the files takes an option. */
export const taken = (products: readonly ProductView[], option: FileOption): boolean =>
  products.some(({ options }) => options.includes(option));

/** Where a file is had, with what was chosen of the options that it takes. */
export function chosenHref(
  { href, options }: Pick<ProductView, "href" | "options">,
  choice: FileChoice,
): string {
  const query = new URLSearchParams(
    options.flatMap((option): [string, string][] => {
      const value = choice[option];
      return value ? [[option, value]] : [];
    }),
  ).toString();
  return query ? `${href}?${query}` : href;
}
