/**
 * Visits that the next allocation keeps: the first ones of a UAV, which are its `committed`. Locking a visit locks those
 * before it, and unlocking one unlocks those after it, as commitments are kept in order and before all else.
 */

import { change } from "./history.js";
import { get } from "./state.js";

/** How many of the first visits of a UAV are locked. @param {string[]} visits ids of areas in order */
export function lockedCount(uav, visits) {
  const committed = uav?.committed ?? [];
  const other = visits.findIndex((id, n) => committed[n] !== id);
  return other < 0 ? visits.length : other;
}

/** Lock the first so many visits of a UAV and no others of them. @param {string[]} visits of the UAV in the plan on screen */
export function lockFirst(uavId, visits, count) {
  const kept = visits.slice(0, count);
  const locked = (uav) => {
    // What is promised beside this plan stays promised, after it.
    const committed = [...kept, ...(uav.committed ?? []).filter((id) => !visits.includes(id))];
    const { committed: _, ...rest } = uav;
    return committed.length ? { ...rest, committed } : rest;
  };
  const of = (problem) => ({ ...problem, uavs: problem.uavs.map((uav) => (uav.id === uavId ? locked(uav) : uav)) });
  const { problem, answerProblem } = get();
  const next = of(problem);
  // A plan that begins with what is locked answers the locked problem as it answered the one before.
  change({ problem: next, ...(answerProblem === problem ? { answerProblem: next } : {}) });
}
