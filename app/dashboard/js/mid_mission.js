/**
 * A mission at a moment of its plan: the service says what remains, and this says what the page makes of it: what has
 * happened until then, and what a new plan changes against the old one. Clocks go on.
 */

import { visitsOf, visitsOfActions, withoutBroken, assignmentOf } from "./draft.js";
import { evaluate } from "./evaluation.js";
import { met } from "./plan.js";
import { normalised } from "./problem.js";
import { withAdded, withRemoved } from "./references.js";
import { homeward } from "./times.js";

/**
 * Ask the service what remains, and what the rest of the plan is worth after what has happened.
 * @param {{problem: object, answer: object, times: object[], fields: object}} plan the plan that goes on
 * @param {object} mission as the store has it
 * @param {AbortSignal} [signal]
 * @returns {Promise<{now: object, rest: object | null, before: string[][]}>} the problem to be allocated again, whose `start_plan` is
 *   what is left of the plan; the evaluation of that, null where it is no plan any more; and what the UAVs of the plan would have visited
 * @throws {ApiError} where the service does not say
 */
export async function momentOf({ problem, answer, times, fields }, mission, signal) {
  const { answer: at, refusal } = await evaluate(problem, answer.assignment, { at: mission.clock, signal });
  if (refusal) throw new Error(refusal.detail);
  const remaining = normalised(at.remaining);
  const before = visitsOfActions(remaining, remaining.start_plan);
  const now = happened(recalled(remaining, { problem, answer, times }, mission), mission, fields);
  return { ...(await judged(now, signal)), before };
}

/** UAVs that fly home, or are back, get tasks again where that is chosen; rewards stay comparable with the plan's. */
function recalled(remaining, { problem, answer, times }, { clock, recall }) {
  const uavs = remaining.uavs.map((uav, i) => {
    if (problem.uavs[i].ret || !(uav.ret || homeward(times[i], clock))) return uav;
    return { ...uav, ret: recall ? 0 : 1 };
  });
  return { ...remaining, uavs, objective: { ...remaining.objective, distance_weight: answer.distance_weight } };
}

/** The problem without the UAVs that are lost, with areas as they are found to be, and new ones. */
function happened(remaining, { lost, happened: told, found }, fields) {
  let now = remaining;
  for (const id of lost) {
    const at = now.uavs.findIndex((uav) => uav.id === id);
    if (at >= 0) now = withRemoved(now, fields, "uavs", at);
  }
  const targets = now.targets.map((target) => {
    const { loadlist = target.loadlist, ...others } = told[target.id] ?? {};
    return { ...(loadlist === target.loadlist ? target : withNeeds(target, loadlist)), ...others };
  });
  return found.reduce((problem, area) => withAdded(problem, "targets", area), { ...now, targets });
}

/** Take the visits that are not allowed any more out of the plan's rest, until the service has a plan. */
async function judged(now, signal) {
  if (!now.uavs.length) return { now, rest: null };
  let visits = visitsOfActions(now, now.start_plan);
  for (;;) {
    const start_plan = assignmentOf(now, visits);
    const { answer, refusal } = await evaluate({ ...now, start_plan: undefined, objective: { ...now.objective, change_weight: undefined } }, start_plan, { signal });
    if (answer) return { now: { ...now, start_plan }, rest: answer };
    const left = withoutBroken(now, visits, refusal.breaches);
    if (left === visits) {
      // Nothing that is left of it is a plan, so that there is nothing to compare with.
      const { start_plan: _plan, ...without } = now;
      const { change_weight: _weight, ...objective } = now.objective;
      return { now: { ...without, objective }, rest: null };
    }
    visits = left;
  }
}

/** An area with other needs than were left: it asked for as much more or less at first. */
export function withNeeds(target, loadlist) {
  if (!target.requested) return { ...target, loadlist };
  return { ...target, loadlist, requested: loadlist.map((need, k) => Math.max(need, target.requested[k] + need - target.loadlist[k])) };
}

/**
 * A new plan beside the rest of the old one.
 * @param {object} problem of the old plan
 * @param {{now: object, rest: object | null, before: string[][]}} moment when the new one begins
 * @param {object} answer the new plan
 */
export function changes(problem, { now, rest, before }, answer) {
  const after = new Map(visitsOf(now, answer).map((visits, i) => [now.uavs[i].id, visits]));
  const routes = problem.uavs.map(({ id }, i) => {
    const is = after.get(id) ?? [];
    const kind = !after.has(id) ? "lost" : before[i].join("\n") === is.join("\n") ? "same" : "changed";
    return { uav_id: id, before: before[i], after: is, kind };
  });
  const [was, is] = [rest && met(now, rest), met(now, answer)];
  const areas = now.targets.map(({ id }) => ({ target_id: id, before: was?.get(id) ?? null, after: is.get(id) }));
  return { routes, areas, kept: rest && { reward: rest.reward } };
}
