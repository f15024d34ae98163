/** Why areas do not get all they need, in the language of the page: by the code of the reason, and the figures beside it. */

import { names, placeNames } from "./plan.js";
import { placeOf } from "./stops.js";
import { listed, shown, t } from "./texts.js";
import { speedText } from "./units.js";

/** What a code means of an area, whatever the plan is like; README.md of the service's domain has the same in English. */
const MEANINGS = {
  no_supply: ({ problem }) => (problem.uavs.every(({ ret }) => ret) ? t("Every UAV is returning.") : t("No UAV that can be sent carries any of it, or can load any.")),
  skills: ({ area }) => (area?.skills?.length ? t("No UAV that carries any of it can do what the area asks for: {skills}.", { skills: listed(area.skills) }) : null),
  excluded: () => t("Every UAV that carries any of it must not be sent there."),
  no_fly_zone: () => t("No way leads there, or home from there, round the no-fly zones."),
  wind: ({ problem }) => (problem.wind ? t("A wind of {speed} is too strong to fly there, or home from there.", { speed: speedText(problem, problem.wind.speed) }) : null),
  out_of_range: () => t("No UAV that carries any of it has the range to fly there, not even directly."),
  deadline: () => t("No UAV that carries any of it is there in time, not even directly."),
  endurance: () => t("A UAV that could bring some of it would be in the air for too long."),
  too_early_to_wait: () => t("A UAV that could bring some of it cannot wait in the air until the area opens."),
  available_until: () => t("A UAV that could bring some of it would land too late."),
  committed: () => t("The UAVs that could bring some of it are committed to other visits first."),
  step_limit: () => t("No UAV has the decision steps left that it takes to bring it."),
  range_used: () => t("A UAV has some of it left over, but its other visits leave it too little range."),
  time_used: () => t("A UAV has some of it left over, but its other visits leave it too little time."),
  loads_used: () => t("The UAVs that could serve it unload elsewhere all that it could use."),
  stock: () => t("What the UAVs carry of it is unloaded elsewhere, and the bases have none left."),
  no_time_for_reload: () => t("A base has some of it left, but no UAV the time to fetch it and bring it."),
  not_worth_it: () => t("One more visit would cost at least what it earns."),
  not_chosen: () => t("One more visit would earn something: a better algorithm or more time finds it."),
};

/** Codes that hold for every plan from where the UAVs are. */
const WHATEVER_THE_PLAN = new Set(["no_supply", "skills", "excluded", "no_fly_zone", "wind", "out_of_range", "deadline", "endurance", "too_early_to_wait", "available_until"]);

/** What is known beside the code. The UAV is the remedy's, where there is one; otherwise the one that the reason is about. */
const DETAILS = {
  out_of_range: ({ uav, remedied }) => uav && !remedied && t("{uav} comes closest.", { uav }),
  deadline: ({ uav, remedied }) => uav && !remedied && t("{uav} would be there first.", { uav }),
  loads_used: ({ remedied, change }) => !remedied && change < 0 && t("To bring it here instead would cost {cost} in reward.", { cost: shown(-change, 3) }),
};

/** Sentences that stand in place of the meaning, where they are known to hold. */
const EXACT = {
  endurance: ({ uav, remedied }) => uav && !remedied && t("{uav} could bring some of it, but would be in the air for too long.", { uav }),
  available_until: ({ uav, remedied }) => uav && !remedied && t("{uav} could bring some of it, but would land too late.", { uav }),
  committed: ({ uav, remedied }) => uav && !remedied && t("{uav} could bring some of it, but is committed to other visits first.", { uav }),
  step_limit: ({ uav, relaxation }) => uav && relaxation?.more_steps > 0 && t("{uav} has some of it left over, but all its decision steps are used.", { uav }),
  range_used: ({ uav, relaxation }) => uav && relaxation?.more_range > 0 && t("{uav} has some of it left over, but its other visits leave it too little range.", { uav }),
  time_used: ({ uav, relaxation }) => uav && relaxation?.later_deadlines?.length > 0 && t("{uav} has some of it left over, but its other visits leave it too little time.", { uav }),
  not_worth_it: ({ uav, remedied }) => uav && !remedied && t("One more visit by {uav} would cost at least what it earns.", { uav }),
  not_chosen({ uav, remedied, relaxation, change, looked, before }) {
    if (!uav || relaxation) return null;
    if (!looked) return t("{uav} carries some of it and could be there in range and time; no further reason was looked for.", { uav });
    if (!remedied) return t("Another flight of {uav} would earn something: a better algorithm or more time finds it.", { uav });
    if (!(change > 0)) return null;
    const values = { uav, gain: shown(change, 3) };
    return before ? t("One more visit by {uav}, after {place}, would earn {gain}: a better algorithm or more time finds it.", { ...values, place: before }) : t("One more visit by {uav}, before all others, would earn {gain}: a better algorithm or more time finds it.", values);
  },
};

/**
 * Why an area does not get all it needs.
 * @param {object} problem @param {object} plan an answer @param {object} unmet one of its `unmet`
 * @returns {string} the service's own sentence, in English, where its code is not known here
 */
export function reasonText(problem, plan, unmet) {
  const facts = {
    problem, area: problem.targets.find(({ id }) => id === unmet.target_id), uav: unmet.uav_id && names(problem.uavs)(unmet.uav_id),
    remedied: typeof unmet.remedy === "string", relaxation: unmet.relaxation, change: unmet.reward_change, looked: unmet.verified !== false, before: stopBefore(problem, plan, unmet),
  };
  const says = EXACT[unmet.code]?.(facts) || MEANINGS[unmet.code]?.(facts);
  return says ? [says, DETAILS[unmet.code]?.(facts)].filter(Boolean).join(" ") : unmet.reason;
}

/** Where the UAV of a reason is before its visit; null: where it is now. */
function stopBefore(problem, plan, { uav_id: uavId, step }) {
  const before = plan.routes?.find((route) => route.uav_id === uavId)?.stops.findLast((stop) => stop.step < step);
  return before ? placeNames(problem)(placeOf(before)) : null;
}

/** Rules that an action of a plan can break, and why a mission's plan loses a stop. */
const RULES = {
  returning: t("a returning UAV makes no more visits"),
  barred: t("no way leads there, or home from there, or the UAV lacks a skill or must not be sent there"),
  range: t("the visit, and the way home where it is required, exceed the range"),
  deadline: t("it arrives after the deadline"),
  committed: t("another visit that the UAV is committed to comes first"),
  endurance: t("the visit, and the way home where it is required, exceed the time in the air that it has"),
  available_until: t("it would land too late"),
  reloaded: t("it has just reloaded"),
  unloads_nothing: t("it would unload nothing"),
  too_much: t("it would unload more than the UAV carries or the area needs"),
  stock: t("it would take more than the base has in stock"),
  capacity: t("with that load the UAV exceeds its capacity"),
  max_steps: t("the plan has more steps than are allowed"),
  uav_lost: t("the UAV is lost"),
  area_cancelled: t("the area was cancelled"),
};

/** The rule that an action breaks. @param {{rule: string, says: string}} breach as `POST /evaluate` and missions have it; a rule that is not known here is in the service's words */
export function ruleText({ rule, says }) {
  return RULES[rule] ?? says;
}

/**
 * Why nothing at all is flown, where no plan could bring anything: how many areas for which reason.
 * @returns {{count: number, says: string}[]} most areas first; nothing where UAVs fly, or another plan might have them fly
 */
export function whyNobodyFlies(problem, { routes, unmet }) {
  if (!unmet.length || routes.some(({ stops }) => stops.length) || unmet.some(({ code }) => !WHATEVER_THE_PLAN.has(code))) return [];
  const counts = new Map();
  for (const { code, target_id: id } of unmet) {
    const says = MEANINGS[code]({ problem, area: problem.targets.find((each) => each.id === id) });
    if (says) counts.set(says, (counts.get(says) ?? 0) + 1);
  }
  return [...counts].map(([says, count]) => ({ count, says })).sort((a, b) => b.count - a.count);
}
