/** Plans that the service still has: listed, and opened again with their problems. */

import { resume, statusName } from "./allocation.js";
import { json } from "./api.js";
import { change, showPlan } from "./history.js";
import { newOpening, normalised } from "./problem.js";
import { get } from "./state.js";
import { t } from "./texts.js";

const KINDS = new Set(["allocate", "batch"]);
/** Plans that are listed at least, where there are as many. */
const ENOUGH = 20;
const ENDED = new Set(["succeeded", "failed", "cancelled"]);

/**
 * A page of the jobs that have plans, newest first.
 * @param {string | null} cursor of the page
 * @returns {Promise<{jobs: object[], next: string | null}>}
 */
export async function recentPlans(cursor = null) {
  const jobs = [];
  // Missions leave many jobs of another kind between the plans.
  do {
    const page = await json(`jobs?limit=100${cursor ? `&cursor=${encodeURIComponent(cursor)}` : ""}`);
    jobs.push(...page.jobs.filter(({ kind }) => KINDS.has(kind)));
    cursor = page.next_cursor;
  } while (cursor && jobs.length < ENOUGH);
  return { jobs, next: cursor };
}

/**
 * Bring a job's problem and plan on screen; a job that goes on is followed. Undoing brings back what was there.
 * @throws {ApiError | Error} where there is no such job, or no plan
 */
export async function openPlan(id) {
  const [job, given] = await Promise.all([json(`jobs/${id}`), json(`jobs/${id}/problem`)]);
  const problem = normalised(given);
  const opening = { problem, problemName: t("Plan {plan}", { plan: id.slice(0, 8) }), opened: newOpening(), colours: {}, selection: null };
  if (job.result?.routes) return showPlan(problem, job.result, opening);
  if (ENDED.has(job.status) || !KINDS.has(job.kind)) throw new Error(t("job {id} ({kind}, {status}) has no plan", { id, kind: job.kind, status: statusName(job.status) }));
  change({ ...opening, answer: null, answerProblem: null, incumbent: null });
  void resume(id, get().problem);
}
