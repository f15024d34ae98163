/** The figures of a plan: what a person asks for first, then the rest of them under Details. */

import { h, number } from "./dom.js";
import { materialName, materialNames } from "./materials.js";
import { factsOf } from "./plan_facts.js";
import { shown, t, tn, tNodes } from "./texts.js";
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

const amountOf = (part, whole) => tNodes("{part} of {whole}", { part: number(part), whole: number(whole) });
const share = (part, whole) => t("{percent} %", { percent: percent(part, whole) });

/** What arrives of what was asked for: of one kind as a figure, of several a line a kind. */
function delivered(problem, { asked, arrived }) {
  if (asked.length === 1) {
    const what = materialNames(problem)?.[0];
    const says = what ? t("{percent} % of {material}", { percent: percent(arrived[0], asked[0]), material: what }) : t("units, {percent} %", { percent: percent(arrived[0], asked[0]) });
    return figure("Delivered", t("Delivered"), amountOf(arrived[0], asked[0]), says);
  }
  const line = (k) => h("span", { class: "amount" }, tNodes("{amount} {material}, {share}", { amount: h("strong", {}, amountOf(arrived[k], asked[k])), material: materialName(problem, k), share: share(arrived[k], asked[k]) }));
  const all = asked.map((_, k) => line(k));
  const more = all.slice(MOST_MATERIALS);
  const rest = more.length ? h("details", {}, h("summary", {}, tn(more.length, "{count} more kind", "{count} more kinds")), more) : null;
  return figure("Delivered", t("Delivered"), [all.slice(0, MOST_MATERIALS), rest].flat(), null, true);
}

/** How far from the best plan that there can be, where that was asked for. */
function sureness({ bound, gap, proof }) {
  if (proof?.proven) return figure("How sure", t("How sure"), t("the best that there is"), t("No plan earns more: that is proven."), true);
  if (typeof gap !== "number") return figure("How sure", t("How sure"), t("not proven"), typeof bound === "number" ? t("The bound says nothing here.") : t("Ask for the bound to know how good the best plan can be."), true);
  if (gap < LEAST_GAP) return figure("How sure", t("How sure"), t("the best that there is"), t("No plan earns more: that is proven."), true);
  return figure("How sure", t("How sure"), t("at least {share} % of the best", { share: shown(100 * (1 - gap), 3) }), t("No plan earns more than the bound: that is proven."), true);
}

/** What the service and the algorithms reckon with. */
function details(answer) {
  const all = [["Reward", t("Reward"), answer.reward], ["Satisfaction", t("Satisfaction"), answer.satisfaction], ["Distance", t("Distance"), answer.distance]];
  for (const each of [["Makespan", t("Makespan"), answer.makespan], ["Changes", t("Changes"), answer.changes], ["Bound", t("Bound"), answer.bound]]) if (typeof each[2] === "number") all.push(each);
  all.push(["λ", "λ", answer.distance_weight, 3], ["Seconds", t("Seconds"), answer.elapsed_s, 3]);
  const exact = typeof answer.gap === "number" && figure("Gap", t("Gap"), h("data", { value: String(answer.gap), title: String(answer.gap) }, answer.gap < LEAST_GAP ? t("under {share} %", { share: 100 * LEAST_GAP }) : t("{share} %", { share: shown(100 * answer.gap, 3) })));
  return h("details", { id: "figures-more" }, h("summary", {}, t("Details")),
    h("dl", { class: "figures" }, all.map(([name, title, value, digits]) => figure(name, title, number(value, digits))), exact));
}

/** The figures of an answer. @returns {HTMLElement[]} those for people, and the rest of them */
export function figures(problem, answer) {
  const facts = factsOf(problem, answer);
  const returns = problem.objective?.return_to_base !== false;
  return [
    h("dl", { class: "figures", id: "figures" },
      figure("Areas served", t("Areas served"), tNodes("{served} of {areas}", { served: number(facts.served), areas: number(facts.areas) }), facts.served === facts.areas ? t("all get all they need") : t("get all they need")),
      delivered(problem, facts),
      figure("Last delivery", t("Last delivery"), moment(problem, facts.lastDelivery)),
      returns ? figure("All home", t("All home"), moment(problem, facts.allHome)) : figure("All done", t("All done"), moment(problem, facts.allHome)),
      figure("Flown", t("Flown"), length(problem, facts.flown), tn(facts.flying, "by {count} UAV", "by {count} UAVs")),
      sureness(answer)),
    details(answer),
  ];
}
