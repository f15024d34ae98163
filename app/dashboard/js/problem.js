/** The problem on screen: making, editing, undoing. All of it in the API's own fields. */

import { notify } from "./dom.js";
import { TYPES } from "./fleet_types.js";
import { change } from "./history.js";
import { BASES, STEMS, ZONES } from "./kinds.js";
import { withAdded, withRemoved, withRenamed } from "./references.js";
import { amountsOf, itemFields } from "./schema.js";
import { get, select, set } from "./state.js";
import { tn } from "./texts.js";

/** A problem with ids filled in and what is not set left out. */
export function normalised({ uavs = [], targets = [], ...settings }) {
  const lists = [BASES, ZONES].filter((list) => settings[list]?.length).map((list) => [list, named(settings[list], STEMS[list])]);
  return { ...present(settings), ...Object.fromEntries(lists), uavs: named(uavs, STEMS.uavs), targets: named(targets, STEMS.targets) };
}

/** Items with ids: the service's own by place in the list, or the next that is free. */
export function named(items, stem) {
  const taken = new Set(items.map(({ id }) => id));
  return items.map((item, at) => {
    const fields = present(item);
    if (fields.id !== undefined) return fields;
    let n = at + 1;
    while (taken.has(`${stem}-${n}`)) n += 1;
    taken.add(`${stem}-${n}`);
    return { id: `${stem}-${n}`, ...fields };
  });
}

function present(fields) {
  return Object.fromEntries(Object.entries(fields).filter(([, value]) => value !== null && value !== undefined));
}

/** Where a UAV is now. */
export function position(uav) {
  return { x: uav.x_c ?? uav.x_s, y: uav.y_c ?? uav.y_s };
}

/** Kinds of material, K. */
export function materials(problem) {
  return (problem.uavs[0] ?? problem.targets[0])?.loadlist.length ?? (problem.materials?.length || 1);
}

/** Bring another problem on screen; undoing brings back the one before with its plan. @param {boolean} [always] also one without anything in it */
export function open(problem, name, always = false) {
  change({
    problem: normalised(problem), problemName: name, opened: newOpening(), colours: {},
    answer: null, answerProblem: null, incumbent: null, selection: null,
  }, always);
}

/** What tells one opening of a problem from all others. */
export function newOpening() {
  return `${Date.now()} ${Math.random()}`;
}

/** Replace the problem by an edited one, which can be undone. */
export function edit(changed) {
  const { problem } = get();
  change({ problem: { ...problem, ...changed(problem) } }, true);
}

/** Change fields of a UAV, area, base or zone; undefined takes a field out. @param {"uavs"|"targets"|"bases"|"no_fly_zones"} kind */
export function update(kind, id, fields) {
  edit((problem) => {
    const items = problem[kind].map((item) => (item.id === id ? present({ ...item, ...fields }) : item));
    const changed = { ...problem, [kind]: items };
    return fields.id && fields.id !== id ? withRenamed(changed, get().fields, kind, id, fields.id) : changed;
  });
  if (fields.id && get().selection?.id === id) set({ selection: { kind, id: fields.id } });
}

export function remove(kind, id) {
  edit((problem) => {
    const at = problem[kind].findIndex((item) => item.id === id);
    return at < 0 ? {} : withRemoved(problem, get().fields, kind, at);
  });
  if (get().selection?.id === id) set({ selection: null });
}

/** Move by hand: a UAV that has not left takes its starting point with it. */
export function move(kind, id, { x, y }) {
  if (kind !== "uavs") return update(kind, id, { x, y });
  const uav = get().problem.uavs.find((each) => each.id === id);
  return update(kind, id, uav.x_c === undefined && uav.y_c === undefined ? { x_s: x, y_s: y } : { x_c: x, y_c: y });
}

/** Move UAVs that wait at one place to another, all together. @param {string[]} ids */
export function moveStarts(ids, { x, y }) {
  const moved = new Set(ids);
  edit((problem) => ({ uavs: problem.uavs.map((uav) => (moved.has(uav.id) ? { ...uav, x_s: x, y_s: y, ...(uav.x_c === undefined ? {} : { x_c: x }), ...(uav.y_c === undefined ? {} : { y_c: y }) } : uav)) }));
}

/** What a new UAV, area or base has besides its place: it resembles the last of its kind. The first UAV on the globe is of the first type. */
export function newItem(kind, problem) {
  const last = problem[kind]?.at(-1);
  if (kind === BASES) return last?.turnaround === undefined ? {} : { turnaround: last.turnaround };
  const amounts = (first) => (last ? [...last.loadlist] : new Array(materials(problem)).fill(first));
  if (kind !== "uavs") return { level: last?.level ?? 1, loadlist: amounts(5) };
  const first = problem.crs === "wgs84" ? TYPES[0] : { speed: 1, voyage: reach(problem), load: 10 };
  return { speed: last?.speed ?? first.speed, voyage: last?.voyage ?? first.voyage, loadlist: amounts(first.load) };
}

/** Place a new UAV, area or base, and select it. */
export function place(kind, { x, y }) {
  const { problem } = get();
  const id = freeId(kind, problem[kind] ?? []);
  const item = { id, ...(kind === "uavs" ? { x_s: x, y_s: y } : { x, y }), ...newItem(kind, problem) };
  edit((now) => (kind === BASES ? { [BASES]: [...(now[BASES] ?? []), item] } : withAdded(now, kind, item)));
  select({ kind, id });
}

/** Add a zone, and select it. @param {number[][]} polygon its corners */
export function addZone(polygon) {
  const zones = get().problem[ZONES] ?? [];
  const zone = { id: freeId(ZONES, zones), polygon };
  edit(() => ({ [ZONES]: [...zones, zone] }));
  select({ kind: ZONES, id: zone.id });
}

/** Take a corner out of a polygon. @param {(polygon: number[][]) => void} changed is given what is left, where that is enough for a zone */
export function withoutCorner(polygon, at, changed) {
  const fewest = fewestCorners();
  if (polygon.length <= fewest) return notify(tn(fewest, "A zone has at least {count} corner: delete the whole zone instead", "A zone has at least {count} corners: delete the whole zone instead"), "error");
  changed(polygon.toSpliced(at, 1));
}

/** How many corners a zone has at least, as the service says. */
export function fewestCorners() {
  return itemFields(get().fields, ZONES).polygon.minItems;
}

/** An id that none of the items has. @param {"uavs"|"targets"|"bases"|"no_fly_zones"} kind */
export function freeId(kind, items) {
  const taken = new Set(items.map((item) => item.id));
  let n = items.length + 1;
  while (taken.has(`${STEMS[kind]}-${n}`)) n += 1;
  return `${STEMS[kind]}-${n}`;
}

/** A range that a first UAV on a plane is given: three times across the areas. */
function reach(problem) {
  const box = extent(problem);
  return box ? 3 * Math.hypot(box.maxX - box.minX, box.maxY - box.minY) || 3 : 3;
}

/** Give every UAV, area and base so many kinds of material. */
export function setMaterials(count) {
  edit((problem) => withMaterials(problem, get().fields, count));
}

/** Give a kind of material, from 0, a name; an empty one takes it away. */
export function nameMaterial(k, name) {
  edit((problem) => {
    const list = Array.from({ length: materials(problem) }, (_, at) => problem.materials?.[at] ?? {}).with(k, present({ ...problem.materials?.[k], name: name || undefined }));
    return { materials: list.some((each) => Object.keys(each).length) ? list : undefined };
  });
}

/** A problem with so many kinds of material; amounts of those that come are 0. */
export function withMaterials(problem, fields, count) {
  const fitted = (kind, items) => {
    const names = amountsOf(itemFields(fields, kind));
    const amounts = (list) => Array.from({ length: count }, (_, k) => list[k] ?? 0);
    return items.map((item) => ({ ...item, ...Object.fromEntries(names.filter((name) => item[name]).map((name) => [name, amounts(item[name])])) }));
  };
  return {
    ...problem, uavs: fitted("uavs", problem.uavs), targets: fitted("targets", problem.targets),
    ...(problem[BASES]?.length ? { [BASES]: fitted(BASES, problem[BASES]) } : {}),
    ...(problem.materials?.length ? { materials: Array.from({ length: count }, (_, k) => problem.materials[k] ?? {}) } : {}),
  };
}

/** What an area asked for at first, an amount a material. */
export function requestedBy(target) {
  return target.requested ?? target.loadlist;
}

/** The box of all positions and corners of zones; null without any. */
export function extent(problem) {
  let box = null;
  const take = (x, y) => {
    box ??= { minX: x, maxX: x, minY: y, maxY: y };
    box.minX = Math.min(box.minX, x);
    box.maxX = Math.max(box.maxX, x);
    box.minY = Math.min(box.minY, y);
    box.maxY = Math.max(box.maxY, y);
  };
  for (const uav of problem.uavs) {
    take(uav.x_s, uav.y_s);
    const now = position(uav);
    take(now.x, now.y);
  }
  for (const { x, y } of [...problem.targets, ...(problem[BASES] ?? [])]) take(x, y);
  for (const { polygon } of problem.no_fly_zones ?? []) for (const [x, y] of polygon) take(x, y);
  return box;
}
