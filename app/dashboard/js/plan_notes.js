/** What is said about a plan as a whole: that it is out of date, whose it is, what the service warns of. */

import { h } from "./dom.js";
import { wayTo } from "./faults.js";
import { get, subscribe } from "./state.js";
import { t, tn } from "./texts.js";

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
  return h("section", { class: "warning", "data-testid": "warnings" }, h("h3", {}, tn(warnings.length, "Is this meant? One thing looks unusual", "Is this meant? {count} things look unusual")),
    h("ul", { class: "violations" }, warnings.map(({ pointer, code, detail }) => h("li", { dataset: { code } }, wayTo(pointer, problem), ` ${detail}`))));
}
