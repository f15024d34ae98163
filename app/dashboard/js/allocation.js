/** One allocation at a time: sent as a job, followed by its events, cancelled with its best plan kept. */

import { ApiError, follow, json } from "./api.js";
import { forgetErrors, notify } from "./dom.js";
import { showPlan } from "./history.js";
import { get, set } from "./state.js";
import { saidErrors, saidOfProblem } from "./said.js";
import { t } from "./texts.js";

/** The request for the problem on screen. An objective that is the API's default is left out. */
export function requestOf(problem, how) {
  return { ...problem, ...how };
}

/**
 * Allocate the problem on screen; the store's `job`, `incumbent` and at the end `answer` follow it.
 * @param {object} how algorithm, parameters, seed, time_limit_s and what else `POST /allocate` takes
 */
export async function allocate(how) {
  const { problem, opened } = get();
  forgetErrors();
  set({ violations: [], incumbent: null, job: begun({ id: null, status: "sending", algorithm: how.algorithm }) });
  await said(async () => {
    const job = await json("allocate", { method: "POST", body: requestOf(problem, how), headers: { Prefer: "respond-async" } });
    take({ id: job.id, status: job.status });
    await followed(job.id, problem, opened);
  });
}

/** Follow a job that goes on, as this page was loaded again or has opened it. */
export async function resume(id, problem, algorithm = null) {
  const { opened } = get();
  set({ incumbent: null, job: begun({ id, status: "reconnecting", algorithm }) });
  await said(() => followed(id, problem, opened));
}

function begun(fields) {
  return { fraction: 0, epoch: null, best_reward: null, trace: [], startedAt: Date.now(), ...fields };
}

async function followed(id, problem, opened) {
  end(problem, opened, await follow(id, (progress) => onProgress(problem, progress), () => take({ status: "reconnecting" })));
}

/** Do it; what goes wrong is said in the job. */
async function said(act) {
  try {
    await act();
  } catch (error) {
    if (!(error instanceof ApiError)) console.error(error);
    const wait = error.retryAfter ? ` ${t("Try again in {seconds} s.", { seconds: error.retryAfter })}` : "";
    const why = `${error.message}.${wait}`.replace("..", ".");
    take({ status: "failed", error: why });
    set({ incumbent: null, violations: error.violations ?? [] });
    // The allocate view says it itself.
    if (get().view !== "allocate") notify(why, "error");
  }
}

/** Stop the running job; what it has found so far becomes the answer. */
export async function cancel() {
  const { job } = get();
  if (!job?.id) return;
  take({ status: "stopping" });
  try {
    await json(`jobs/${job.id}`, { method: "DELETE" });
  } catch (error) {
    notify(error.message, "error");
  }
}

const STATUSES = {
  sending: t("sending"), queued: t("queued"), running: t("running"), reconnecting: t("reconnecting"), stopping: t("stopping"),
  succeeded: t("succeeded"), failed: t("failed"), cancelled: t("cancelled"),
};

/** What a status of a job is called: one of the service, or of a job whose request or stream is on its way. */
export function statusName(status) {
  return STATUSES[status] ?? status;
}

/** Whether a job is under way. */
export function running(job) {
  return job !== null && ["sending", "queued", "running", "reconnecting", "stopping"].includes(job.status);
}

function take(fields) {
  set({ job: { ...get().job, ...fields } });
}

function onProgress(problem, progress) {
  const { job, incumbent } = get();
  const { fraction, epoch = null, best_reward = null, assignment } = progress;
  const rose = best_reward !== null && best_reward !== job.trace.at(-1)?.reward;
  const point = { t: (Date.now() - job.startedAt) / 1000, epoch, reward: best_reward };
  const status = job.status === "stopping" ? "stopping" : (progress.status ?? "running");
  take({ status, fraction, epoch, best_reward, trace: rose ? [...job.trace, point] : job.trace });
  if (assignment && JSON.stringify(assignment) !== JSON.stringify(incumbent?.assignment)) set({ incumbent: { problem, assignment } });
}

function end(problem, opened, job) {
  const { trace, startedAt } = get().job;
  const last = { t: (Date.now() - startedAt) / 1000, epoch: job.progress.epoch, reward: job.result?.reward ?? null };
  take({ status: job.status, error: job.error && saidOfProblem(job.error), fraction: job.progress.fraction, best_reward: last.reward ?? job.progress.best_reward, trace: last.reward === null ? trace : [...trace, last] });
  set({ incumbent: null, violations: saidErrors(job.error?.errors) });
  if (job.error && get().view !== "allocate") notify(saidOfProblem(job.error), "error");
  if (!job.error && !job.result) notify(t("The job was cancelled before it had a plan"));
  if (!job.result) return;
  if (get().opened === opened) showPlan(problem, job.result);
  else notify(t("The plan of the problem before is ready: it is among the recent plans"));
}
