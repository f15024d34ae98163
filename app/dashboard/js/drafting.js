/**
 * The plan on screen while it is changed by hand: each change is a step of undo, kept with the problem, and judged by
 * the service. The store's `draft` is null, or `{visits, evaluation, refusal, trouble}`: what the UAVs visit, and one of
 * the answer, the rules that are broken, and why the service has not said yet; all null while it is asked.
 */

import { assignmentOf, visitsFor, visitsOf } from "./draft.js";
import { evaluate } from "./evaluation.js";
import { change } from "./history.js";
import { get, set, subscribe } from "./state.js";

const UNJUDGED = { evaluation: null, refusal: null, trouble: null };
let asking = null;

/** Begin to change the plan on screen. */
export function beginDraft() {
  const { answer, answerProblem } = get();
  change({ draft: { ...UNJUDGED, visits: visitsOf(answerProblem, answer), evaluation: answer } });
}

/** @param {string[][]} visits another plan */
export function changeDraft(visits) {
  change({ draft: { ...UNJUDGED, visits } });
}

/** Ask the service again. */
export function judgeAgain() {
  set({ draft: { ...get().draft, ...UNJUDGED } });
}

/** Make it the plan on screen. */
export function keepDraft() {
  const { draft } = get();
  change({ answer: draft.evaluation, incumbent: null, draft: null });
}

/** Go back to the plan as it was; undoing brings the change back. */
export function dropDraft() {
  change({ draft: null });
}

/** The next allocation begins with a plan, and is never worse. @param {string[][]} visits of the UAVs of the plan on screen */
export function beginWith(visits) {
  const { problem, answerProblem } = get();
  const begun = { ...problem, start_plan: assignmentOf(problem, visitsFor(problem, answerProblem, visits)) };
  // The plan on screen earns the same in a problem that only begins with another, unless changes cost something.
  const same = answerProblem === problem && !problem.objective?.change_weight;
  change({ problem: begun, ...(same ? { answerProblem: begun } : {}) });
}

/** Ask of each draft that nobody has judged, wherever it comes from: an edit, undo, or a page that is loaded again. */
export function judgeDrafts() {
  const judge = async () => {
    const { draft, answerProblem } = get();
    if (!draft || draft.evaluation || draft.refusal || draft.trouble) return;
    asking?.abort();
    asking = new AbortController();
    const { signal } = asking;
    const told = (facts) => { if (get().draft === draft) set({ draft: { ...draft, ...facts } }); };
    try {
      const { answer = null, refusal = null } = await evaluate(answerProblem, assignmentOf(answerProblem, draft.visits), { signal });
      told({ evaluation: answer, refusal });
    } catch (error) {
      if (!signal.aborted) told({ trouble: error.message });
    }
  };
  subscribe(["draft"], judge);
  void judge();
}
