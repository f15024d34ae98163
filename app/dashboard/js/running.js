/** Allocations and trainings that a view starts by itself: sent as jobs, followed, and read at their end. */

import { follow, json } from "./api.js";
import { saidOfProblem } from "./said.js";

/**
 * Run an allocation to its end.
 * @param {object} body of `POST /allocate`
 * @param {{onProgress?: (progress: object, seconds: number) => void, signal?: AbortSignal}} [options]
 *   an aborted signal cancels the job; its best plan is the answer then, if it has one
 * @returns {Promise<object | null>} the answer; null where there is none
 */
export async function allocate(body, { onProgress = () => {}, signal } = {}) {
  const job = await json("allocate", { method: "POST", body, headers: { Prefer: "respond-async" } });
  const cancel = () => json(`jobs/${job.id}`, { method: "DELETE" }).catch(() => {});
  if (signal?.aborted) await cancel();
  signal?.addEventListener("abort", cancel, { once: true });
  try {
    return (await finished(job.id, onProgress)).result;
  } finally {
    signal?.removeEventListener("abort", cancel);
  }
}

/** Follow a job to its end; throws where it failed. */
export async function finished(id, onProgress = () => {}) {
  const began = performance.now();
  const job = await follow(id, (data) => onProgress(data, (performance.now() - began) / 1000));
  if (job.error) throw new Error(saidOfProblem(job.error));
  return job;
}
