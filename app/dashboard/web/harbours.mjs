/**
 * Writes the names of the world's harbours for the map, the largest first: node harbours.mjs UpdatedPub150.csv FILE
 *
 * The table is the "complete volume" of the World Port Index (Pub. 150) as the National Geospatial-Intelligence Agency of
 * the United States gives it out, a work of that government and so in the public domain (17 U.S.C. § 105).
 */

import { readFile, writeFile } from "node:fs/promises";

const [source, target] = process.argv.slice(2);
const SIZES = ["Very Small", "Small", "Medium", "Large"];
/** A twentieth of the minute to which most are given. */
const DIGITS = 3;

/** The rows of a comma-separated table, each by its titles; a cell in quotes may hold commas, and a quote as two. */
function rowsOf(text) {
  const [titles, ...rows] = text.split(/\r?\n/).map((line) =>
    [...line.matchAll(/(?:^|,)(?:"((?:[^"]|"")*)"|([^,]*))/g)].map(([, quoted, plain]) =>
      (quoted?.replaceAll('""', '"') ?? plain).trim(),
    ),
  );
  return rows
    .filter(({ length }) => length === titles.length)
    .map((row) => Object.fromEntries(row.map((cell, i) => [titles[i], cell])));
}

const rounded = (degrees) => Number(Number(degrees).toFixed(DIGITS));

const harbours = rowsOf((await readFile(source, "utf8")).replace(/^\uFEFF/, "")).map((row) => ({
  size: Math.max(SIZES.indexOf(row["Harbor Size"]), 0),
  cells: [
    rounded(row.Latitude),
    rounded(row.Longitude),
    row["Main Port Name"],
    row["Country Code"],
    row["Alternate Port Name"],
  ],
}));
const byName = (a, b) => a.cells[2].localeCompare(b.cells[2], "en") || a.cells[0] - b.cells[0];
harbours.sort((a, b) => b.size - a.size || byName(a, b));
const lines = harbours.map(({ size, cells }) => [size, ...cells].join("\t").trimEnd());
const title = "# World Port Index (Pub. 150) of the National Geospatial-Intelligence Agency, public domain";
await writeFile(target, `${[title, ...new Set(lines)].join("\n")}\n`);
