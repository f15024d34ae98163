/** Remedies for unmet needs: what each would take, in words, and as a change of the problem or of the plan. */

import { beginDraft, changeDraft } from "./drafting.js";
import { withVisit } from "./draft.js";
import { amountsText } from "./materials.js";
import { names } from "./plan.js";
import { edit } from "./problem.js";
import { get } from "./state.js";
import { betweenAmounts, shown, t, tn } from "./texts.js";
import { durationText, lengthText } from "./units.js";

/** What would help, in words; null where nothing simple would. @param {object} unmet as the answer has it */
export function remedyText(problem, unmet) {
  const { relaxation, uav_id: uavId } = unmet;
  if (typeof unmet.remedy !== "string") return null;
  const uav = names(problem.uavs)(uavId);
  if (!relaxation) return t("one more visit by {uav}", { uav });
  const area = names(problem.targets);
  const { more_load: load = [], more_range: range = 0, more_steps: steps = 0, later_deadlines: later = [] } = relaxation;
  return [
    load.some((amount) => amount > 0) && t("{amounts} more aboard {uav}", { amounts: amountsText(problem, load), uav }),
    range > 0 && t("{length} more range of {uav}", { length: lengthText(problem, range), uav }),
    ...later.map(({ target_id: id, by }) => t("a deadline {time} later for {area}", { time: durationText(problem, by), area: area(id) })),
    steps > 0 && tn(steps, "one more decision step", "{count} more decision steps"),
  ].filter(Boolean).join(betweenAmounts());
}

/** What the reward gains or loses by it, in words; null where nobody has reckoned it. */
export function changeText({ reward_change: change }) {
  if (typeof change !== "number") return null;
  const said = { change: shown(change, 3) };
  return change < 0 ? t("reward {change}: it costs more than it earns", said) : t("reward +{change}", said);
}

/** A problem in which a remedy is allowed. */
export function withRemedy(problem, { uav_id: uavId, relaxation }) {
  const { more_load: load = [], more_range: range = 0, more_steps: steps = 0, later_deadlines: later = [] } = relaxation;
  const by = new Map(later.map((each) => [each.target_id, each.by]));
  const helped = (uav) => ({ ...uav, loadlist: uav.loadlist.map((amount, k) => amount + (load[k] ?? 0)), voyage: uav.voyage + range });
  return {
    uavs: problem.uavs.map((uav) => (uav.id === uavId ? helped(uav) : uav)),
    targets: problem.targets.map((target) => (by.has(target.id) ? { ...target, deadline: target.deadline + by.get(target.id) } : target)),
    ...(steps ? { max_steps: (problem.max_steps ?? get().fields.settings.max_steps.default) + steps } : {}),
  };
}

/** Allow it in the problem on screen: one step of undo. */
export function allow(unmet) {
  edit((problem) => withRemedy(problem, unmet));
}

/** Put the visit into the plan on screen, as a change by hand that the service judges. */
export function addVisit({ uav_id: uavId, target_id: id, step }) {
  const { answer, answerProblem } = get();
  if (!get().draft) beginDraft();
  const uav = answerProblem.uavs.findIndex((each) => each.id === uavId);
  const before = answer.routes.find((route) => route.uav_id === uavId)?.stops.filter((stop) => stop.step < step).length ?? 0;
  const { visits } = get().draft;
  changeDraft(withVisit(visits, { uav, at: Math.min(before, visits[uav].length) }, id));
}
