/** The page's address: the view, the plan where a view shows one, as `#/answer?job=…`, and the mission, as `#/missions/…`. */

import { get, set, subscribe } from "./state.js";

const OF_A_PLAN = new Set(["answer", "take-away"]);
/** The view whose address has the mission that is open. */
const OF_A_MISSION = "missions";

/** What an address says. @returns {{view: string, job: string | null, mission: string | null} | null} null: nothing of ours */
export function read(hash) {
  const found = /^#\/([\w-]+)(?:\/([0-9a-f]{32}))?(?:\?job=([0-9a-f]{32}))?$/.exec(hash);
  return found && { view: found[1], mission: found[2] ?? null, job: found[3] ?? null };
}

function written() {
  const { view, answer, openMission } = get();
  if (view === OF_A_MISSION && openMission) return `#/${view}/${openMission.id}`;
  return `#/${view}${answer?.job_id && OF_A_PLAN.has(view) ? `?job=${answer.job_id}` : ""}`;
}

/**
 * Keep the address from now on: Back and Forward go between views, an address that is typed opens its plan.
 * @param {(job: string) => void} openPlan
 * @param {(mission: string | null) => void} openMission null: none is open
 */
export function keepAddress(openPlan, openMission) {
  let going = false;
  const stay = () => history.replaceState({ ours: true }, "", written());
  const go = () => { if (!going && written() !== location.hash) history.pushState({ ours: true }, "", written()); };
  subscribe(["view", "openMission"], go);
  subscribe(["answer"], stay);
  addEventListener("popstate", ({ state }) => {
    const asked = read(location.hash);
    if (!asked) return;
    going = true;
    set({ view: asked.view });
    if (asked.view === OF_A_MISSION) openMission(asked.mission);
    going = false;
    if (!state?.ours && asked.job && asked.job !== get().answer?.job_id) openPlan(asked.job);
    else stay();
  });
  stay();
}
