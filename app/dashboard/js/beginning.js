/** What the next allocation begins with: locked visits, and a plan that it may only better. */

import { visitsOfActions } from "./draft.js";
import { h } from "./dom.js";
import { edit } from "./problem.js";
import { sum } from "./plan.js";
import { uavCount } from "./sizes.js";
import { get, subscribe } from "./state.js";
import { baseOf } from "./stops.js";
import { t, tn } from "./texts.js";

/** A line each, there while there is something, with the way to leave it out. */
export function beginningNotes() {
  const notes = h("ul", { class: "violations", id: "begins-with" });
  const line = (name, text, title, act) => h("li", { dataset: { begins: name } }, text, " ", h("button", { type: "button", class: "quiet", onclick: act }, title));
  const without = ({ committed: _, ...uav }) => uav;
  const draw = () => {
    const { problem } = get();
    const committed = problem?.uavs.filter((uav) => uav.committed?.length) ?? [];
    const visits = problem?.start_plan ? visitsOfActions(problem, problem.start_plan) : [];
    const all = sum(visits.map((list) => list.filter((place) => baseOf(place) === null).length));
    notes.replaceChildren(
      ...(committed.length ? [line("locked", t("Keeps {visits} of {uavs}.", { visits: tn(sum(committed.map((uav) => uav.committed.length)), "{count} locked visit", "{count} locked visits"), uavs: uavCount(committed.length) }), t("Unlock all"), () => edit(({ uavs }) => ({ uavs: uavs.map(without) })))] : []),
      ...(problem?.start_plan ? [line("plan", tn(all, "Begins with a plan of {count} visit, and gives none that earns less.", "Begins with a plan of {count} visits, and gives none that earns less."), t("Begin anew"), () => edit(() => ({ start_plan: undefined })))] : []));
    notes.hidden = !notes.childElementCount;
  };
  subscribe(["problem"], draw);
  draw();
  return notes;
}
