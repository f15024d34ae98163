/** The problem on screen: making, editing, undoing. All of it in the API's own fields. */

import { get, set } from "./state.js";

const MOST_UNDONE = 100;

/** A problem with ids and positions filled in, and nothing that the API does not know of a problem. */
export function normalised(given) {
  return {
    max_steps: given.max_steps ?? 5,
    crs: given.crs ?? "local",
    objective: { distance_weight: null, return_to_base: true, charge_return: false, ...given.objective },
    uavs: (given.uavs ?? []).map((uav, i) => ({ id: `uav-${i + 1}`, ...present(uav) })),
    targets: (given.targets ?? []).map((target, j) => ({ id: `area-${j + 1}`, ...present(target) })),
  };
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
  return (problem.uavs[0] ?? problem.targets[0])?.loadlist.length ?? 1;
}

/** Bring another problem on screen; what was found for the one before goes. */
export function open(problem, name) {
  const full = normalised(problem);
  set({
    problem: full, problemName: name, past: [], future: [],
    answer: null, answerProblem: null, incumbent: null, violations: [], selection: null,
  });
}

/** Replace the problem by an edited one, which can be undone. */
export function edit(change) {
  const { problem, past } = get();
  const next = { ...problem, ...change(problem) };
  set({ problem: next, past: [...past, problem].slice(-MOST_UNDONE), future: [], violations: [] });
}

export function undo() {
  const { problem, past, future } = get();
  if (past.length) set({ problem: past.at(-1), past: past.slice(0, -1), future: [problem, ...future], violations: [] });
}

export function redo() {
  const { problem, past, future } = get();
  if (future.length) set({ problem: future[0], past: [...past, problem], future: future.slice(1), violations: [] });
}

/** Change fields of a UAV or area; undefined takes a field out. @param {"uavs"|"targets"} kind */
export function update(kind, id, fields) {
  edit((problem) => ({
    [kind]: problem[kind].map((item) => (item.id === id ? present({ ...item, ...fields }) : item)),
  }));
  if (fields.id && get().selection?.id === id) set({ selection: { kind, id: fields.id } });
}

export function remove(kind, id) {
  edit((problem) => ({ [kind]: problem[kind].filter((item) => item.id !== id) }));
  if (get().selection?.id === id) set({ selection: null });
}

/** Move by hand: a UAV that has not left takes its starting point with it. */
export function move(kind, id, { x, y }) {
  if (kind === "targets") return update(kind, id, { x, y });
  const uav = get().problem.uavs.find((each) => each.id === id);
  return update(kind, id, uav.x_c === undefined && uav.y_c === undefined ? { x_s: x, y_s: y } : { x_c: x, y_c: y });
}

/** Place a new UAV or area; it resembles the last of its kind. */
export function place(kind, { x, y }) {
  const { problem } = get();
  const last = problem[kind].at(-1);
  const id = freeId(problem[kind], kind === "uavs" ? "uav" : "area");
  const loadlist = last ? [...last.loadlist] : new Array(materials(problem)).fill(kind === "uavs" ? 10 : 5);
  const item =
    kind === "uavs"
      ? { id, x_s: x, y_s: y, speed: last?.speed ?? 1, voyage: last?.voyage ?? reach(problem), loadlist }
      : { id, x, y, level: last?.level ?? 1, loadlist };
  edit((now) => ({ [kind]: [...now[kind], item] }));
  set({ selection: { kind, id } });
}

function freeId(items, stem) {
  const taken = new Set(items.map((item) => item.id));
  let n = items.length + 1;
  while (taken.has(`${stem}-${n}`)) n += 1;
  return `${stem}-${n}`;
}

/** A range that a first UAV is given: three times across the areas, or as far as a plain number goes. */
function reach(problem) {
  const box = extent(problem);
  if (problem.crs === "wgs84") return 100;
  return box ? 3 * Math.hypot(box.maxX - box.minX, box.maxY - box.minY) || 3 : 3;
}

/** Give every UAV and area so many kinds of material. */
export function setMaterials(count) {
  const fitted = (items) =>
    items.map((item) => ({ ...item, loadlist: Array.from({ length: count }, (_, k) => item.loadlist[k] ?? 0) }));
  edit((problem) => ({ uavs: fitted(problem.uavs), targets: fitted(problem.targets) }));
}

/** The box of all positions; null without any. */
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
  for (const target of problem.targets) take(target.x, target.y);
  return box;
}
