/**
 * The world's harbours, of the World Port Index (Pub. 150; harbours.mjs makes the table). Most lie within a minute of where it
 * says: enough to find one's way, not to steer by. Fetched from the service when first wanted.
 */

import type { LngLat } from "../api/types";
import { fetchedOnce } from "./fetchedOnce";
import address from "./harbours.tsv?url";

export interface Harbour {
  /** From 0, very small or not known, to 3. */
  size: number;
  at: LngLat;
  name: string;
  country: string;
  /** Its other names, each with a semicolon before it but the first. */
  others: string;
}

/** Asks for the harbours, the largest first. */
export const harbours = fetchedOnce(
  address,
  async (answer): Promise<readonly Harbour[]> => harboursOf(await answer.text()),
);

export function harboursOf(table: string): Harbour[] {
  const lines = table.split("\n").filter((line) => line && !line.startsWith("#"));
  return lines.map((line) => {
    const [size = "", lat = "", lng = "", name = "", country = "", others = ""] = line.split("\t");
    return { size: Number(size), at: [Number(lng), Number(lat)], name, country, others };
  });
}

/** Letters alone, as they are without accents: the table has none. */
const plain = (text: string): string =>
  text
    .normalize("NFD")
    .replace(/\p{Diacritic}/gu, "")
    .toLowerCase();

/** Fewer letters fit too many names. */
const LEAST_LETTERS = 2;

/** Harbours in whose names a text stands: as their beginning first, then as a word's, then in other names. */
export function harboursNamed(all: readonly Harbour[], text: string, most: number): Harbour[] {
  const wanted = plain(text.trim());
  if (wanted.length < LEAST_LETTERS) return [];
  const rank = ({ name, others }: Harbour): number => {
    const own = plain(name);
    if (own.startsWith(wanted)) return 0;
    if (own.includes(` ${wanted}`)) return 1;
    if (` ${plain(others)}`.includes(` ${wanted}`)) return 2;
    return own.includes(wanted) ? 3 : 4;
  };
  return all
    .map((harbour) => ({ harbour, rank: rank(harbour) }))
    .filter((found) => found.rank < 4)
    .sort((a, b) => a.rank - b.rank)
    .slice(0, most)
    .map(({ harbour }) => harbour);
}
