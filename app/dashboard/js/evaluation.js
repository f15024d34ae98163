/** What the service says of a plan that nobody searched for: what it earns, or which rules it breaks. */

import { ApiError, json } from "./api.js";

/** The type of the refusal of a plan; any other is of the problem, or of the service. */
const ILLEGAL = "/docs/errors#illegal-plan";

/**
 * Evaluate a plan.
 * @param {object} problem
 * @param {number[][]} assignment joint actions
 * @param {{signal?: AbortSignal}} [options]
 * @returns {Promise<{answer: object} | {refusal: {detail: string, breaches: object[]}}>} an answer, or what is wrong with the plan
 * @throws {ApiError} where the service does not say
 */
export async function evaluate(problem, assignment, { signal } = {}) {
  try {
    return { answer: await json("evaluate", { method: "POST", body: { ...problem, assignment }, signal }) };
  } catch (error) {
    if (!(error instanceof ApiError) || error.problem.type !== ILLEGAL) throw error;
    return { refusal: { detail: error.message, breaches: error.problem.breaches ?? [] } };
  }
}
