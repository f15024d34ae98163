/** A plan as the places that each UAV stops at, of visits and reloads, which are moved, added and removed by hand. No page, no requests. */

import { called, placeNames } from "./plan.js";
import { ruleText } from "./reasons.js";
import { placeOf, placeOfAction, placesOf } from "./stops.js";
import { t } from "./texts.js";

/** The places that each UAV stops at, in order. @returns {string[][]} one list a UAV of the problem */
export function visitsOf(problem, answer) {
  const routes = new Map(answer.routes.map((route) => [route.uav_id, route]));
  return problem.uavs.map(({ id }) => (routes.get(id)?.stops ?? []).map(placeOf));
}

/** The same as joint actions, one a step: who has no more visits flies home. */
export function assignmentOf(problem, visits) {
  const home = problem.targets.length;
  const index = new Map([...placesOf(problem).keys()].map((place, at) => [place, at + Number(at >= home)]));
  const steps = Math.max(1, ...visits.map((list) => list.length));
  return Array.from({ length: steps }, (_, step) => visits.map((list) => index.get(list[step]) ?? home));
}

/** Joint actions as the visits of each UAV. */
export function visitsOfActions(problem, assignment) {
  return problem.uavs.map((_, i) => assignment.map((row) => placeOfAction(problem, row[i])).filter((id) => id !== undefined));
}

/** A plan of a problem for another one, in which UAVs and areas may be gone, new or in another order. */
export function visitsFor(problem, before, visits) {
  const known = placesOf(problem);
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
  const who = uav ? called(uav) : t("The plan");
  const where = breach.target_id === null ? who : t("{uav}, visit {step} ({area})", { uav: who, step: breach.step, area: placeNames(problem)(breach.target_id) });
  const figures = breach.needed === null ? "" : `: ${t("needs {needed}, has {had}", { needed: breach.needed, had: breach.had })}`;
  return `${where}: ${ruleText(breach)}${figures}`;
}
