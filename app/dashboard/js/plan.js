/** What a plan looks like: where routes go, what areas get. */

import { position, requestedBy } from "./problem.js";

/** What an item is called: its name, where it has one; names need not be unique, so its id stands beside it. */
export function called({ id, name }) {
  return name ?? id;
}

/** What items are called, by their ids. @returns {(id: string) => string} */
export function names(items) {
  const known = new Map(items.map((item) => [item.id, called(item)]));
  return (id) => known.get(id) ?? id;
}

/** How long a UAV waits for its n-th visit (from 0), and whether before it takes off. */
export function waiting(uav, stop, n) {
  const time = (stop.begin_time ?? stop.arrival_time) - stop.arrival_time;
  return { time, onGround: n === 0 && stateOf(uav) === "at its base" && !uav.airborne };
}

/**
 * Routes of an answer, or of a list of joint actions, in one form.
 * @param {object} problem
 * @param {object | number[][]} plan an answer of the API, or an incumbent's `assignment`
 * @returns {{uav: object, index: number, stops: {target: object, stop: object | null}[], points: {x, y}[]}[]}
 *   only of UAVs that visit something; points begin at the present position, turn where the way does, and end at
 *   the start, or at the last stop where the UAV need not return
 */
export function routesOf(problem, plan) {
  if (!plan) return [];
  const visits = Array.isArray(plan) ? visitsOfActions(problem, plan) : visitsOfAnswer(problem, plan);
  const landings = new Map(Array.isArray(plan) ? [] : plan.routes.map((route) => [route.uav_id, route.landing]));
  return problem.uavs
    .map((uav, index) => ({
      uav,
      index,
      stops: visits[index],
      points: [position(uav), ...visits[index].flatMap(({ target, stop }) => beyond(stop?.path, target)), ...wayHome(problem, uav, landings.get(uav.id))],
    }))
    .filter(({ stops }) => stops.length);
}

/** Points of a way after its first: where it turns, and where it ends. */
function beyond(path, there) {
  return path ? path.slice(1).map(([x, y]) => ({ x, y })) : [there];
}

/** The same of the way home; the answer to a problem without a world says nothing of it. */
function wayHome(problem, uav, landing) {
  const home = { x: uav.x_s, y: uav.y_s };
  if (landing === undefined) return [home];
  return problem.objective?.return_to_base === false ? [] : beyond(landing?.path, home);
}

function visitsOfActions(problem, assignment) {
  return problem.uavs.map((_, i) =>
    assignment
      .map((joint) => problem.targets[joint[i]])
      .filter((target) => target !== undefined)
      .map((target) => ({ target, stop: null })),
  );
}

function visitsOfAnswer(problem, answer) {
  const targets = new Map(problem.targets.map((target) => [target.id, target]));
  const routes = new Map(answer.routes.map((route) => [route.uav_id, route]));
  return problem.uavs.map((uav) =>
    (routes.get(uav.id)?.stops ?? []).map((stop) => ({ target: targets.get(stop.target_id), stop })),
  );
}

/**
 * How much of what each area asked for it has, with what an answer brings, 0 to 1; an area that needs nothing is met.
 * @returns {Map<string, number>} by target id
 */
export function met(problem, answer) {
  const remaining = new Map((answer?.unmet ?? []).map((each) => [each.target_id, sum(each.remaining)]));
  return new Map(
    problem.targets.map((target) => {
      const requested = sum(requestedBy(target));
      if (requested === 0) return [target.id, 1];
      return [target.id, 1 - (answer ? (remaining.get(target.id) ?? 0) : sum(target.loadlist)) / requested];
    }),
  );
}

/** What a UAV is doing, in a word. */
export function stateOf(uav) {
  if (uav.ret) return "returning";
  const now = position(uav);
  return (uav.dis ?? 0) > 0 || now.x !== uav.x_s || now.y !== uav.y_s ? "in the air" : "at its base";
}

/** Range left of a UAV as the problem has it. */
export function rangeLeft(uav) {
  return uav.voyage - (uav.dis ?? 0);
}

/** The same as a share of the whole range, 0 to 1. */
export function rangeShare(uav) {
  return uav.voyage > 0 ? Math.max(0, Math.min(1, rangeLeft(uav) / uav.voyage)) : 0;
}

/** Urgency class 1 to 5 of a level, against the highest of the problem. */
export function urgency(level, highest) {
  return highest > 0 ? Math.min(5, Math.max(1, Math.ceil((5 * level) / highest))) : 1;
}

export function sum(numbers) {
  return numbers.reduce((total, each) => total + each, 0);
}
