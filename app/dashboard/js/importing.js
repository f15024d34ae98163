/** The items of a list, brought into a problem. */

import { distinct } from "./formats.js";
import { STEMS } from "./kinds.js";
import { materials, named, withMaterials } from "./problem.js";
import { withAdded, withRemoved } from "./references.js";
import { amountsOf, itemFields } from "./schema.js";

/**
 * A problem with items of a list.
 * @param {object} problem on screen
 * @param {object} fields as `fieldsOf` gives them
 * @param {"uavs"|"targets"|"bases"} kind
 * @param {object[]} items as `itemsOf` gives them
 * @param {{how: "add"|"replace"|"new", crs?: string, materials?: (string | undefined)[]}} options beside what is there, in the place of
 *   all of the kind, or as a new problem with these positions; names of the materials, for those that have none
 * @returns {{problem: object, notices: string[]}} what is told besides is in `notices`; a new problem has no ids filled in
 */
export function withItems(problem, fields, kind, items, { how, crs, materials: names = [] }) {
  const notices = [];
  const start = how === "new" ? { crs, uavs: [], targets: [] } : how === "replace" ? without(problem, fields, kind) : problem;
  const carried = amountsOf(itemFields(fields, kind))[0];
  const asked = Math.max(1, ...items.map((item) => item[carried]?.length ?? 0));
  const count = Math.max(materials(start), asked);
  const before = withNames(withMaterials({ ...start, [kind]: start[kind] ?? [] }, fields, count), fields, names, count);
  const fitted = items.map((item) => (item[carried] ? { ...item, [carried]: Array.from({ length: count }, (_, k) => item[carried][k] ?? 0) } : item));
  const all = named(distinct([...before[kind], ...fitted], kind, itemFields(fields, kind).id.maxLength, notices), STEMS[kind]);
  const changed = all.slice(before[kind].length).reduce((now, item) => withAdded(now, kind, item), before);
  return { problem: changed, notices };
}

/** A problem whose materials have names, where they had none. */
function withNames(problem, fields, names, count) {
  if (!names.slice(0, count).some(Boolean)) return problem;
  const longest = itemFields(fields, "materials").name.maxLength;
  const short = (name) => [...name.replace(/\p{Cc}+/gu, " ")].slice(0, longest).join("");
  const named = Array.from({ length: count }, (_, k) => ({ ...(names[k] ? { name: short(names[k]) } : {}), ...problem.materials?.[k] }));
  return { ...problem, materials: named };
}

function without(problem, fields, kind) {
  let changed = problem;
  while (changed[kind]?.length) changed = withRemoved(changed, fields, kind, changed[kind].length - 1);
  return changed;
}
