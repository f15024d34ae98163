/** What is said about a plan as a whole: that it is out of date, whose it is, what the service warns of. */

import { h } from "./dom.js";
import { wayTo } from "./faults.js";
import { whyNobodyFlies } from "./reasons.js";
import { get, subscribe } from "./state.js";
import { t, tn } from "./texts.js";
import { MOST_OF_A_CODE, warningText } from "./warnings.js";

/** Whether the problem on screen is another than the one that the plan answers. */
export function outOfDate() {
  const { answer, answerProblem, problem } = get();
  return answer !== null && answerProblem !== problem;
}

/** A line that is there while the plan is out of date. */
export function staleNote(id, text) {
  const note = h("p", { class: "warning", id }, text);
  const mark = () => { note.hidden = !outOfDate(); };
  subscribe(["answer", "problem", "answerProblem"], mark);
  mark();
  return note;
}

/** Whose plan it is, where it is not the one's who was asked; null otherwise. */
export function answeredBy({ algorithm, answered_by: by }) {
  return by && by !== algorithm ? h("span", { class: "chip warn", "data-testid": "answered-by" }, t("answered by {by}, not {algorithm}", { by, algorithm })) : null;
}

/** What the service warns of, each with the way to its field; null without any. */
export function warningsOf(answer, problem) {
  const { warnings = [] } = answer;
  if (!warnings?.length) return null;
  const item = (warning) => h("li", { dataset: { code: warning.code }, title: warning.detail }, wayTo(warning.pointer, problem), ` ${warningText(problem, warning)}`);
  const many = warnings.some(({ code }) => warnings.filter((each) => each.code === code).length >= MOST_OF_A_CODE);
  return h("section", { class: "warning", "data-testid": "warnings" }, h("h3", {}, tn(warnings.length, "Is this meant? One thing looks unusual", "Is this meant? {count} things look unusual")),
    h("ul", { class: "violations" }, warnings.map(item)), many && h("p", {}, t("There may be more: of one kind {count} are listed at most.", { count: MOST_OF_A_CODE })));
}

/** Why nobody flies, where no plan could bring anything to anybody; null otherwise. */
export function nobodyFlies(answer, problem) {
  const why = whyNobodyFlies(problem, answer);
  if (!why.length) return null;
  return h("section", { class: "warning", id: "nobody-flies" }, h("h3", {}, t("Nobody flies: no plan brings anything to any area")),
    h("ul", { class: "violations" }, why.map(({ count, says }) => h("li", {}, tn(count, "{count} area: {reason}", "{count} areas: {reason}", { reason: says })))));
}
