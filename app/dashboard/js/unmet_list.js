/** Areas that do not get all they need: how much is missing, why, and what would help, with a button that does it. */

import { h, notify } from "./dom.js";
import { undo } from "./history.js";
import { amountsCell, amountsText } from "./materials.js";
import { names } from "./plan.js";
import { Portions } from "./portions.js";
import { requestedBy } from "./problem.js";
import { reasonText } from "./reasons.js";
import { addVisit, allow, changeText, remedyText } from "./remedies.js";
import { get, select, set, subscribe } from "./state.js";
import { t, tn, tNodes } from "./texts.js";

/** The problem on screen as it was before a remedy was allowed in it, by the entry: until then it can be allowed. */
const allowed = new WeakMap();
/** Buttons of remedies on the page, with their entries. */
const buttons = new Map();

/** @param {object[]} wanted those of the plan's unmet needs that are shown, in order @param {boolean} changing whether the plan is being changed by hand: then only visits can be added @returns {{element: HTMLElement, portions: Portions}} */
export function unmetList(problem, plan, wanted, changing) {
  const requested = new Map(problem.targets.map((target) => [target.id, requestedBy(target)]));
  const nameOf = names(problem.targets);
  const item = (unmet) => {
    const asked = requested.get(unmet.target_id);
    const lacking = unmet.remaining.map((amount, k) => (amount > 0 ? asked[k] : 0));
    return h("li", { dataset: { targetId: unmet.target_id, code: unmet.code } },
      h("div", { class: "row spread" },
        h("button", { type: "button", class: "quiet", title: unmet.target_id, onclick: () => select({ kind: "targets", id: unmet.target_id }) }, nameOf(unmet.target_id)),
        h("span", { class: "lacks" }, tNodes("lacks {amounts} of {asked}", { amounts: h("strong", {}, amountsCell(problem, unmet.remaining)), asked: amountsText(problem, lacking) }))),
      h("p", { class: "hint", title: unmet.reason }, reasonText(problem, plan, unmet)), remedyOf(problem, unmet, changing));
  };
  const list = h("ul", { class: "unmet", id: "unmet" });
  const portions = new Portions(list, wanted, item, (button) => h("li", {}, button));
  const count = plan.unmet.length;
  const title = count ? tn(count, "{count} of {areas} areas lacks something", "{count} of {areas} areas lack something", { areas: problem.targets.length }) : t("All {areas} areas get all they need", { areas: problem.targets.length });
  return { element: h("details", { open: count > 0 }, h("summary", {}, title), list), portions };
}

function remedyOf(problem, unmet, changing) {
  const says = remedyText(problem, unmet);
  if (!says) return null;
  const gains = changeText(unmet);
  return h("div", { class: "row remedy" }, h("p", {}, tNodes("Would help: {remedy}.", { remedy: says }), gains && h("span", { class: "hint" }, ` (${gains})`)), button(problem, unmet, changing));
}

function button(problem, unmet, changing) {
  const where = names(problem.targets)(unmet.target_id);
  if (!unmet.relaxation) {
    if (!unmet.step) return null;
    return h("button", { type: "button", "aria-label": t("Add the visit to {area}", { area: where }), onclick: () => addVisit(unmet) }, t("Add the visit"));
  }
  if (changing) return null;
  const made = h("button", { type: "button", dataset: { remedy: unmet.target_id }, onclick: () => {
    allowed.set(unmet, get().problem);
    allow(unmet);
    notify(t("The problem allows it now: {remedy}. Allocate again for a plan with it.", { remedy: remedyText(problem, unmet) }), "info", { title: t("Undo"), act: undo });
  } }, t("Apply"));
  buttons.set(made, unmet);
  mark(made, unmet);
  return h("span", { class: "row" }, made, h("button", { type: "button", class: "quiet", hidden: true, dataset: { again: unmet.target_id }, onclick: () => set({ view: "allocate" }) }, t("Allocate again")));
}

/** A remedy that is in the problem on screen is not offered again. */
function mark(made, unmet) {
  const before = allowed.get(unmet);
  const applied = before !== undefined && get().problem !== before;
  made.disabled = applied;
  made.textContent = applied ? t("Applied") : t("Apply");
  made.setAttribute("aria-label", applied ? t("Applied for {area}", { area: unmet.target_id }) : t("Apply for {area}", { area: unmet.target_id }));
  if (made.nextElementSibling) made.nextElementSibling.hidden = !applied;
}

subscribe(["problem"], () => {
  for (const [made, unmet] of buttons) {
    if (made.isConnected) mark(made, unmet);
    else buttons.delete(made);
  }
});
