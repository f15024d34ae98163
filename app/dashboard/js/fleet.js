/** Several UAVs at once: of a type, or like one that is there. */

import { edit, freeId, materials } from "./problem.js";
import { withAdded } from "./references.js";

/** What a UAV is in the middle of, which another one like it is not. */
const UNDER_WAY = ["id", "name", "x_c", "y_c", "dis", "airborne", "ret", "committed"];

/**
 * UAVs of a type, at a place, loaded with equal weights of every material, in whole units of those that the problem names. Weights are in kg; a unit
 * that has none weighs 1, as for the service.
 * @param {object} problem that they are for
 * @param {{name: string, speed: number, voyage: number, load: number}} type of `TYPES`
 * @param {number} count
 * @param {{x: number, y: number}} place
 * @returns {object[]} with ids and names that no UAV of the problem has
 */
export function fleetOf(problem, { name, speed, voyage, load }, count, { x, y }) {
  const whole = Boolean(problem.materials?.length);
  const weights = Array.from({ length: materials(problem) }, (_, k) => problem.materials?.[k]?.weight ?? 1);
  const loadlist = loadOf(load, weights, whole);
  const names = new Set(problem.uavs.map((uav) => uav.name));
  const uavs = [];
  for (let n = 1; uavs.length < count; n += 1) {
    const called = `${name} ${n}`;
    if (names.has(called)) continue;
    uavs.push({ id: freeId("uavs", [...problem.uavs, ...uavs]), name: called, x_s: x, y_s: y, speed, voyage, loadlist: [...loadlist], ...(whole ? { capacity: load } : {}) });
  }
  return uavs;
}

/** Amounts that weigh no more than the load. @param {number[]} weights @param {boolean} whole whether they are whole units */
function loadOf(load, weights, whole) {
  const fitting = (room, weight) => (whole ? Math.floor(room / weight + 1e-9) : room / weight);
  const amounts = weights.map((weight) => (weight ? fitting(load / weights.length, weight) : 0));
  // What whole units leave free, those that still fit may fill.
  let left = load - amounts.reduce((sum, amount, k) => sum + amount * weights[k], 0);
  weights.forEach((weight, k) => {
    const more = weight ? fitting(left, weight) : 0;
    amounts[k] += more;
    left -= more * weight;
  });
  return amounts;
}

/**
 * UAVs like one that is there, at its starting point and with nothing behind them.
 * @param {object[]} uavs all that are there
 * @param {object} uav
 * @param {number} count
 * @returns {object[]} with ids that go on where its own is: after `mid-2` comes `mid-3`
 */
export function uavsLike(uavs, uav, count) {
  const like = Object.fromEntries(Object.entries(uav).filter(([field]) => !UNDER_WAY.includes(field)));
  const [, stem, number] = /^(.*?)(\d+)$/.exec(uav.id) ?? [null, `${uav.id}-`, "1"];
  const taken = new Set(uavs.map(({ id }) => id));
  const made = [];
  for (let n = Number(number) + 1; made.length < count; n += 1) if (!taken.has(`${stem}${n}`)) made.push({ id: `${stem}${n}`, ...structuredClone(like) });
  return made;
}

/** Add UAVs to the problem on screen, as one step. */
export function addUavs(uavs) {
  edit((problem) => uavs.reduce((now, uav) => withAdded(now, "uavs", uav), problem));
}
