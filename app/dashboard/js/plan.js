/** What a plan looks like: where routes go, what areas get. */

import { position, requestedBy } from "./problem.js";
import { baseOf, flightsOf, isReload, placeOf, placeOfAction, placesOf } from "./stops.js";
import { t } from "./texts.js";

/** What an item is called: its name, where it has one; names need not be unique, so its id stands beside it. */
export function called({ id, name }) {
  return name ?? id;
}

/** What items are called, by their ids. @returns {(id: string) => string} */
export function names(items) {
  const known = new Map(items.map((item) => [item.id, called(item)]));
  return (id) => known.get(id) ?? id;
}

/** What a base is called among other stops. @param {string} name or id */
export function baseName(name) {
  return t("base {name}", { name });
}

/** What places are called; of a base that it is one. @returns {(place: string) => string} */
export function placeNames(...problems) {
  const known = new Map(problems.flatMap((problem) => [...placesOf(problem)]));
  return (place) => {
    const item = known.get(place);
    const name = item ? called(item) : (baseOf(place) ?? place);
    return baseOf(place) === null ? name : baseName(name);
  };
}

/** How long a UAV waits at its n-th stop (from 0), and whether before it takes off. */
export function waiting(uav, stops, n) {
  const stop = stops[n];
  const time = (stop.begin_time ?? stop.arrival_time) - stop.arrival_time;
  return { time, onGround: n === 0 ? stateOf(uav) === "at its base" && !uav.airborne : isReload(stops[n - 1]) };
}

/**
 * Routes of an answer, or of a list of joint actions, in one form.
 * @param {object} problem
 * @param {object | number[][]} plan an answer of the API, or an incumbent's `assignment`
 * @returns {{uav: object, index: number, stops: {place: string, item: object}[], flights: {number: number, points: {x, y}[]}[]}[]}
 *   only of UAVs that stop somewhere; the points of a flight begin where it begins, turn where the way does, and end where it lands,
 *   or at the last stop where the UAV need not return
 */
export function routesOf(problem, plan) {
  if (!plan) return [];
  const places = placesOf(problem);
  const known = Array.isArray(plan) ? null : new Map(plan.routes.map((route) => [route.uav_id, route]));
  return problem.uavs
    .map((uav, index) => {
      const route = known ? (known.get(uav.id) ?? { stops: [] }) : routeOfActions(problem, plan, index);
      const stops = route.stops.map((stop) => ({ place: placeOf(stop), item: places.get(placeOf(stop)) }));
      return { uav, index, stops, flights: legsOf(problem, uav, route, stops) };
    })
    .filter(({ stops }) => stops.length);
}

/** A route of which nothing is known but where it leads. */
function routeOfActions(problem, assignment, index) {
  const places = assignment.map((joint) => placeOfAction(problem, joint[index])).filter((place) => place !== undefined);
  return { stops: places.map((place) => (baseOf(place) === null ? { target_id: place } : { kind: "reload", base_id: baseOf(place), distance: 1 })) };
}

/** The points of each flight of a route. */
function legsOf(problem, uav, route, stops) {
  const numbers = flightsOf(route);
  let from = position(uav);
  const flights = [];
  route.stops.forEach((stop, n) => {
    if (flights.at(-1)?.number !== numbers[n]) flights.push({ number: numbers[n], points: [from] });
    flights.at(-1).points.push(...beyond(stop.path, stops[n].item));
    from = stops[n].item;
  });
  const home = wayHome(problem, uav, route.landing);
  if (isReload(route.stops.at(-1))) {
    // The last flight leads from a base straight home, where it is not home already.
    if (home.length && route.return_distance !== 0) flights.push({ number: numbers.at(-1) + 1, points: [from, ...home] });
  } else flights.at(-1)?.points.push(...home);
  return flights;
}

/** Points of a way after its first: where it turns, and where it ends. */
function beyond(path, there) {
  return path ? path.slice(1).map(([x, y]) => ({ x, y })) : [there];
}

/** The same of the way home; the answer to a problem without a world says nothing of it. */
function wayHome(problem, uav, landing) {
  const base = problem.bases?.find(({ id }) => id === landing?.base_id);
  const home = base ?? { x: uav.x_s, y: uav.y_s };
  if (landing === undefined) return [home];
  return problem.objective?.return_to_base === false ? [] : beyond(landing?.path, home);
}

/**
 * How much of what each area asked for it has, with what an answer brings if it says so, 0 to 1; an area that needs nothing
 * is met.
 * @returns {Map<string, number>} by target id
 */
export function met(problem, answer) {
  const remaining = answer?.unmet && new Map(answer.unmet.map((each) => [each.target_id, sum(each.remaining)]));
  return new Map(
    problem.targets.map((target) => {
      const requested = sum(requestedBy(target));
      if (requested === 0) return [target.id, 1];
      return [target.id, 1 - (remaining ? (remaining.get(target.id) ?? 0) : sum(target.loadlist)) / requested];
    }),
  );
}

/** What a UAV is doing: `returning`, `in the air` or `at its base`. */
export function stateOf(uav) {
  if (uav.ret) return "returning";
  const now = position(uav);
  return (uav.dis ?? 0) > 0 || now.x !== uav.x_s || now.y !== uav.y_s ? "in the air" : "at its base";
}

const STATES = { returning: t("returning"), "in the air": t("in the air"), "at its base": t("at its base") };

/** The same in words. */
export function stateText(uav) {
  return STATES[stateOf(uav)];
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
