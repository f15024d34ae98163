/** What a person asks of a plan first: who is served, how much arrives, when the last of it does, when all are home. */

import { met, sum } from "./plan.js";
import { requestedBy } from "./problem.js";
import { allTimes } from "./times.js";
import { baseOf } from "./stops.js";

/**
 * @param {object} problem
 * @param {object} answer
 * @returns {{served: number, areas: number, asked: number[], arrived: number[], lastDelivery: number | null, allHome: number | null, flown: number, flying: number}}
 *   areas that have all they asked for, of all areas; amounts a material that areas asked for, and that they have with the plan; when the
 *   last unloading has ended and when the last UAV that flies is home, null where none is; the length of all flights, home too; how many UAVs fly
 */
export function factsOf(problem, answer) {
  const shares = met(problem, answer);
  const kinds = (problem.targets[0] ?? problem.uavs[0]).loadlist;
  const asked = kinds.map((_, k) => sum(problem.targets.map((target) => requestedBy(target)[k])));
  const missing = kinds.map((_, k) => sum(answer.unmet.map(({ remaining }) => remaining[k])));
  const flies = answer.routes.map(({ stops, return_distance: home }) => stops.length > 0 || home > 0);
  const times = allTimes(problem, answer).filter((_, i) => flies[i]);
  const unloaded = times.flatMap(({ stops }) => stops.filter(({ id }) => baseOf(id) === null).map(({ done }) => done));
  const latest = (all) => (all.length ? Math.max(...all) : null);
  return {
    served: problem.targets.filter(({ id }) => shares.get(id) >= 1).length, areas: problem.targets.length,
    asked, arrived: asked.map((amount, k) => Math.max(0, amount - missing[k])),
    lastDelivery: latest(unloaded), allHome: latest(times.map(({ home }) => home)),
    flown: sum(answer.routes.map(({ distance, return_distance: home }) => distance + home)),
    flying: flies.filter(Boolean).length,
  };
}
