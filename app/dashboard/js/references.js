/** What in a problem refers to its UAVs, areas and bases: ids in lists of words, and the places in a plan to begin from. */

import { BASES, ZONES } from "./kinds.js";
import { isIdsOf } from "./schema.js";

/** A problem in which an item of a list has another id wherever it is named. */
export function withRenamed(problem, fields, list, before, after) {
  return withIds(problem, fields, list, (ids) => ids.map((id) => (id === before ? after : id)));
}

/** A problem whose list has lost the item at a place: nothing names it, and the plan goes on without it. */
export function withRemoved(problem, fields, list, at) {
  if (list === ZONES) return { ...problem, [list]: problem[list].toSpliced(at, 1) };
  const { id } = problem[list][at];
  const home = problem.targets.length;
  const without = withIds({ ...problem, [list]: problem[list].toSpliced(at, 1) }, fields, list, (ids) => ids.filter((each) => each !== id));
  if (list === BASES) return problem.start_plan ? { ...without, start_plan: withoutReloads(problem.start_plan, home, home + 1 + at) } : without;
  const rows = problem.start_plan?.map((row) => {
    if (list === "uavs") return row.toSpliced(at, 1);
    return row.map((action) => (action === at ? home - 1 : action - Number(action > at)));
  });
  return rows ? { ...without, start_plan: rows } : without;
}

/** A problem whose list has got an item at its end, which the plan leaves where it is. */
export function withAdded(problem, list, item) {
  const home = problem.targets.length;
  const rows = problem.start_plan?.map((row) => (list === "uavs" ? [...row, home] : row.map((action) => action + Number(action >= home))));
  return { ...problem, [list]: [...problem[list], item], ...(rows ? { start_plan: rows } : {}) };
}

/** A plan without the reloads at a base: what a UAV does after one comes a step sooner. */
function withoutReloads(rows, home, gone) {
  const columns = rows[0]?.map((_, i) => rows.map((row) => row[i]).filter((action) => action !== gone).map((action) => action - Number(action > gone))) ?? [];
  return rows.map((_, step) => columns.map((actions) => actions[step] ?? home));
}

function withIds(problem, fields, list, change) {
  const changed = {};
  for (const holder of ["uavs", "targets"]) {
    const names = Object.entries(fields?.[holder] ?? {}).filter(([, schema]) => isIdsOf(schema, list)).map(([name]) => name);
    if (!problem[holder].some((item) => names.some((name) => item[name]?.length))) continue;
    changed[holder] = problem[holder].map((item) => ({ ...item, ...Object.fromEntries(names.filter((name) => item[name]).map((name) => [name, change(item[name])])) }));
  }
  return { ...problem, ...changed };
}
