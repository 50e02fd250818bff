/**
 * Writes what the form needs of the service's OpenAPI document: type, bounds and defaults of a mission's plain fields, by
 * their paths. node mission.mjs DOCUMENT FILE
 */

import { readFile, writeFile } from "node:fs/promises";

const [source, target] = process.argv.slice(2);
const text = source.startsWith("http") ? await (await fetch(source)).text() : await readFile(source, "utf8");
const { components, paths } = JSON.parse(text);
const { schemas } = components;
const KEPT = /^(type|minimum|maximum|exclusiveMinimum|exclusiveMaximum|maxItems|maxLength|pattern|enum|default|description)$/;

/** A schema without references; of alternatives the one that is not null. */
function whole({ $ref, anyOf, ...own }) {
  if ($ref) return { ...whole(schemas[$ref.split("/").at(-1)]), ...own };
  const kinds = anyOf?.filter(({ type }) => type !== "null");
  return kinds ? { ...whole(kinds[0]), ...own, nullable: kinds.length < anyOf.length } : own;
}

function* leaves(schema, path = []) {
  const { properties, items, prefixItems, examples, nullable, ...rest } = whole(schema);
  const inner = Object.entries(properties ?? prefixItems ?? {});
  // A trained controller is a document of its own: it comes in a file.
  if (path.join(".") === "planner.options.model") return;
  for (const [name, one] of inner) yield* leaves(one, [...path, name]);
  if (properties) return;
  if (items) yield* leaves(items, path);
  const kept = Object.entries(rest).filter(([key]) => KEPT.test(key));
  const orders = rest["x-orders"] ? { orders: rest["x-orders"] } : {};
  const example = typeof examples?.[0] === "number" ? { example: examples[0] } : {};
  yield [path.join("."), { ...Object.fromEntries(kept), ...example, ...orders, ...(nullable ? { nullable } : {}) }];
}

/** Values by their paths. */
const flat = (tree, path = []) =>
  Object.entries(tree).flatMap(([name, value]) =>
    typeof value === "object" ? flat(value, [...path, name]) : [[[...path, name].join("."), value]],
  );

const fields = Object.fromEntries(leaves(schemas.MissionSpec));
for (const [path, value] of flat(schemas.MissionSpec.properties.search["x-defaults"])) fields[path].inSearch = value;
for (const [name, { default: usual }] of Object.entries(schemas.MissionSpec.properties)) {
  if (typeof usual !== "object" || Array.isArray(usual)) continue;
  for (const [path, value] of flat(usual, [name])) fields[path].default = value;
}
// How deep it is is asked with a plan, and is no value of the mission.
const [floor] = paths["/api/v1/plan"].post.parameters.filter(({ name }) => name === "floor_depth_m");
fields.floor_depth_m = { ...leaves(floor.schema).next().value[1], description: floor.description };
await writeFile(target, `${JSON.stringify(fields, null, 2)}\n`);
