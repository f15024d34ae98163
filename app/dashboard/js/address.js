/** The page's address: the view, and the plan where a view shows one, as `#/answer?job=…`. */

import { get, set, subscribe } from "./state.js";

const OF_A_PLAN = new Set(["answer", "field", "take-away"]);

/** What an address says. @returns {{view: string, job: string | null} | null} null: nothing of ours */
export function read(hash) {
  const found = /^#\/([\w-]+)(?:\?job=([0-9a-f]{32}))?$/.exec(hash);
  return found && { view: found[1], job: found[2] ?? null };
}

function written() {
  const { view, answer } = get();
  return `#/${view}${answer?.job_id && OF_A_PLAN.has(view) ? `?job=${answer.job_id}` : ""}`;
}

/**
 * Keep the address from now on: Back and Forward go between views, an address that is typed opens its plan.
 * @param {(job: string) => void} openPlan
 */
export function keepAddress(openPlan) {
  let going = false;
  const stay = () => history.replaceState({ ours: true }, "", written());
  subscribe(["view"], () => { if (!going) history.pushState({ ours: true }, "", written()); });
  subscribe(["answer"], stay);
  addEventListener("popstate", ({ state }) => {
    const asked = read(location.hash);
    if (!asked) return;
    going = true;
    set({ view: asked.view });
    going = false;
    if (!state?.ours && asked.job && asked.job !== get().answer?.job_id) openPlan(asked.job);
    else stay();
  });
  stay();
}
