/** Undo and redo: a step holds what belongs together, the problem, its plan and the colours. */

import { notify } from "./dom.js";
import { get, set } from "./state.js";
import { t } from "./texts.js";

const MOST_UNDONE = 100;
const PARTS = ["problem", "problemName", "opened", "answer", "answerProblem", "draft", "colours"];

/** What is on screen, as a step. */
export function present() {
  const state = get();
  return Object.fromEntries(PARTS.map((part) => [part, state[part]]));
}

/** Replace what is on screen, with a way back to what it was. @param {object} patch of the store @param {boolean} [always] also to a problem without anything in it */
export function change(patch, always = false) {
  const { problem, answer, past } = get();
  const worth = problem && (always || answer || problem.uavs.length || problem.targets.length);
  // What was changed by hand belongs to the plan that it was made of.
  const draft = "answer" in patch && !("draft" in patch) ? { draft: null } : {};
  set({ violations: [], ...draft, ...patch, past: worth ? [...past, present()].slice(-MOST_UNDONE) : past, future: [] });
}

/** Bring a plan on screen, with the problem that it answers. @param {object} [rest] of the store */
export function showPlan(problem, answer, rest = {}) {
  const shown = { answer, answerProblem: problem, incumbent: null, ...rest };
  // A first plan takes nothing away: what is undone then is the newest edit.
  const aside = get().draft;
  if (get().answer || ("problem" in rest && rest.problem !== get().problem)) change(shown);
  else set(shown);
  if (aside) notify(t("The plan that you were changing is set aside: Undo brings it back"), "info", { title: t("Undo"), act: undo });
}

export function undo() {
  const { past, future } = get();
  if (past.length) goTo(past.at(-1), past.slice(0, -1), [present(), ...future]);
}

export function redo() {
  const { past, future } = get();
  if (future.length) goTo(future[0], [...past, present()], future.slice(1));
}

function goTo(step, past, future) {
  const { selection } = get();
  const there = selection && step.problem[selection.kind]?.some(({ id }) => id === selection.id);
  set({ draft: null, ...step, past, future, incumbent: null, violations: [], selection: there ? selection : null });
}
