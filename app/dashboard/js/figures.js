/** The figures of a plan: what a person asks for first, then the rest of them under Details. */

import { h, number, shown } from "./dom.js";
import { materialName, materialNames } from "./materials.js";
import { factsOf } from "./plan_facts.js";
import { counted, filled, filledText } from "./sentences.js";
import { length, moment } from "./units.js";

const LEAST_GAP = 1e-5;
const MOST_MATERIALS = 4;

function figure(name, title, value, hint = null, wide = false) {
  return h("div", { class: wide ? "figure wide" : "figure", dataset: { figure: name } }, h("dt", {}, title), h("dd", {}, value), hint && h("dd", { class: "hint" }, hint));
}

/** A share as a whole percentage that is 100 only where nothing is missing. */
function percent(part, whole) {
  if (!(whole > 0)) return 100;
  return part >= whole ? 100 : Math.min(99, Math.round((100 * part) / whole));
}

const amountOf = (part, whole) => filled("{part} of {whole}", { part: number(part), whole: number(whole) });
const share = (part, whole) => filledText("{percent} %", { percent: percent(part, whole) });

/** What arrives of what was asked for: of one kind as a figure, of several a line a kind. */
function delivered(problem, { asked, arrived }) {
  if (asked.length === 1) {
    const what = materialNames(problem)?.[0];
    const says = what ? filledText("{percent} % of {material}", { percent: percent(arrived[0], asked[0]), material: what }) : filledText("units, {percent} %", { percent: percent(arrived[0], asked[0]) });
    return figure("Delivered", "Delivered", amountOf(arrived[0], asked[0]), says);
  }
  const line = (k) => h("span", { class: "amount" }, filled("{amount} {material}, {share}", { amount: h("strong", {}, amountOf(arrived[k], asked[k])), material: materialName(problem, k), share: share(arrived[k], asked[k]) }));
  const all = asked.map((_, k) => line(k));
  const more = all.slice(MOST_MATERIALS);
  const rest = more.length ? h("details", {}, h("summary", {}, filledText("{count} more kinds", { count: more.length })), more) : null;
  return figure("Delivered", "Delivered", [all.slice(0, MOST_MATERIALS), rest].flat(), null, true);
}

/** How far from the best plan that there can be, where that was asked for. */
function sureness({ bound, gap }) {
  if (typeof gap !== "number") return figure("How sure", "How sure", "not proven", typeof bound === "number" ? "The bound says nothing here." : "Ask for the bound to know how good the best plan can be.", true);
  if (gap < LEAST_GAP) return figure("How sure", "How sure", "the best that there is", "No plan earns more: that is proven.", true);
  return figure("How sure", "How sure", filledText("at least {share} % of the best", { share: shown(100 * (1 - gap), 3) }), "No plan earns more than the bound: that is proven.", true);
}

/** What the service and the algorithms reckon with. */
function details(answer) {
  const all = [["Reward", "Reward", answer.reward], ["Satisfaction", "Satisfaction", answer.satisfaction], ["Distance", "Distance", answer.distance]];
  for (const [name, value] of [["Makespan", answer.makespan], ["Changes", answer.changes]]) if (typeof value === "number") all.push([name, name, value]);
  if (typeof answer.bound === "number") all.push(["Bound", "Bound", answer.bound]);
  all.push(["λ", "λ", answer.distance_weight, 3], ["Seconds", "Seconds", answer.elapsed_s, 3]);
  const exact = typeof answer.gap === "number" && figure("Gap", "Gap", h("data", { value: String(answer.gap), title: String(answer.gap) }, answer.gap < LEAST_GAP ? "under 0.001 %" : filledText("{share} %", { share: shown(100 * answer.gap, 3) })));
  return h("details", { id: "figures-more" }, h("summary", {}, "Details"),
    h("dl", { class: "figures" }, all.map(([name, title, value, digits]) => figure(name, title, number(value, digits))), exact));
}

/** The figures of an answer. @returns {HTMLElement[]} those for people, and the rest of them */
export function figures(problem, answer) {
  const facts = factsOf(problem, answer);
  const returns = problem.objective?.return_to_base !== false;
  return [
    h("dl", { class: "figures", id: "figures" },
      figure("Areas served", "Areas served", filled("{served} of {areas}", { served: number(facts.served), areas: number(facts.areas) }), facts.served === facts.areas ? "all get all they need" : "get all they need"),
      delivered(problem, facts),
      figure("Last delivery", "Last delivery", moment(problem, facts.lastDelivery)),
      returns ? figure("All home", "All home", moment(problem, facts.allHome)) : figure("All done", "All done", moment(problem, facts.allHome)),
      figure("Flown", "Flown", length(problem, facts.flown), counted(facts.flying, { one: "by 1 UAV", other: filledText("by {count} UAVs", { count: facts.flying }) })),
      sureness(answer)),
    details(answer),
  ];
}
