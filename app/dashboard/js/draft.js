/** A plan as the visits of each UAV, which are moved, added and removed by hand. No page, no requests. */

import { called, names } from "./plan.js";
import { shown } from "./dom.js";

/** The ids of the areas that each UAV visits, in order. @returns {string[][]} one list a UAV of the problem */
export function visitsOf(problem, answer) {
  const routes = new Map(answer.routes.map((route) => [route.uav_id, route]));
  return problem.uavs.map(({ id }) => (routes.get(id)?.stops ?? []).map((stop) => stop.target_id));
}

/** The same as joint actions, one a step: who has no more visits flies home. */
export function assignmentOf(problem, visits) {
  const index = new Map(problem.targets.map(({ id }, j) => [id, j]));
  const steps = Math.max(1, ...visits.map((list) => list.length));
  return Array.from({ length: steps }, (_, step) => visits.map((list) => index.get(list[step]) ?? problem.targets.length));
}

/** Joint actions as the visits of each UAV. */
export function visitsOfActions(problem, assignment) {
  return problem.uavs.map((_, i) => assignment.map((row) => problem.targets[row[i]]?.id).filter((id) => id !== undefined));
}

/** A plan of a problem for another one, in which UAVs and areas may be gone, new or in another order. */
export function visitsFor(problem, before, visits) {
  const known = new Set(problem.targets.map(({ id }) => id));
  const of = new Map(before.uavs.map(({ id }, i) => [id, visits[i]]));
  return problem.uavs.map(({ id }) => (of.get(id) ?? []).filter((each) => known.has(each)));
}

/** @param {{uav: number, at: number}} visit places in the lists */
export function withoutVisit(visits, { uav, at }) {
  return visits.with(uav, visits[uav].toSpliced(at, 1));
}

/** @param {{uav: number, at: number}} place where the visit stands then, at most at the end */
export function withVisit(visits, { uav, at }, id) {
  return visits.with(uav, visits[uav].toSpliced(at, 0, id));
}

/** Move a visit; the place is one of the lists without it. */
export function withMoved(visits, from, to) {
  return withVisit(withoutVisit(visits, from), to, visits[from.uav][from.at]);
}

/** A plan without the visits that break a rule; the same where none of them is one. @param {object[]} breaches as `POST /evaluate` has them */
export function withoutBroken(problem, visits, breaches) {
  const broken = new Set(breaches.map(({ uav_id: id, step }) => `${problem.uavs.findIndex((uav) => uav.id === id)} ${step - 1}`));
  const left = visits.map((list, i) => list.filter((_, at) => !broken.has(`${i} ${at}`)));
  return left.every((list, i) => list.length === visits[i].length) ? visits : left;
}

/** A rule that an action breaks, in words with its figures. @param {object} breach as `POST /evaluate` has it */
export function saidOfBreach(breach, problem) {
  const uav = problem.uavs.find(({ id }) => id === breach.uav_id);
  const where = breach.target_id === null ? "" : `, visit ${breach.step} (${names(problem.targets)(breach.target_id)})`;
  const figures = breach.needed === null ? "" : `: needs ${shown(breach.needed)}, has ${shown(breach.had)}`;
  return `${uav ? called(uav) : "The plan"}${where}: ${breach.says}${figures}`;
}
