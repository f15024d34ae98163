/**
 * The state of a mission at a moment of its plan, as a problem that can be allocated again (x_c, y_c, dis, ret,
 * what is still carried and needed), and what a new plan changes against the old one. No page, no requests.
 */

import { idOf } from "./kinds.js";
import { sum } from "./plan.js";
import { requestedBy } from "./problem.js";

const EARTH_RADIUS_KM = 6371.0088;
const radians = (degrees) => (degrees * Math.PI) / 180;
const degrees = (angle) => (angle * 180) / Math.PI;

/** Distance of two points [x, y], in the problem's units or km. */
export function distance(crs, [xa, ya], [xb, yb]) {
  if (crs !== "wgs84") return Math.hypot(xa - xb, ya - yb);
  const h =
    Math.sin(radians(yb - ya) / 2) ** 2 +
    Math.cos(radians(ya)) * Math.cos(radians(yb)) * Math.sin(radians(xb - xa) / 2) ** 2;
  return 2 * EARTH_RADIUS_KM * Math.asin(Math.min(1, Math.sqrt(h)));
}

/** The point a fraction of the way from one to the other: on the line, or on the great circle. */
export function between(crs, from, to, fraction) {
  const [xa, ya] = from;
  const [xb, yb] = to;
  if (fraction <= 0) return from;
  if (fraction >= 1) return to;
  if (crs !== "wgs84") return [xa + (xb - xa) * fraction, ya + (yb - ya) * fraction];
  const angle = distance(crs, from, to) / EARTH_RADIUS_KM;
  if (angle < 1e-12) return from;
  const a = Math.sin((1 - fraction) * angle) / Math.sin(angle);
  const b = Math.sin(fraction * angle) / Math.sin(angle);
  const x = a * Math.cos(radians(ya)) * Math.cos(radians(xa)) + b * Math.cos(radians(yb)) * Math.cos(radians(xb));
  const y = a * Math.cos(radians(ya)) * Math.sin(radians(xa)) + b * Math.cos(radians(yb)) * Math.sin(radians(xb));
  const z = a * Math.sin(radians(ya)) + b * Math.sin(radians(yb));
  return [degrees(Math.atan2(y, x)), degrees(Math.atan2(z, Math.hypot(x, y)))];
}

const uavId = (uav, i) => idOf("uavs", uav, i);
const targetId = (target, j) => idOf("targets", target, j);
const rounded = (amount) => (Math.abs(amount) < 1e-9 ? 0 : amount);
const less = (amounts, taken) => amounts.map((amount, k) => Math.max(0, rounded(amount - taken[k])));

/** When the last UAV is home. */
export function missionEnd(problem, answer) {
  const byId = new Map(problem.targets.map((target, j) => [targetId(target, j), target]));
  return Math.max(
    0,
    ...answer.routes.map((route, i) => {
      const last = route.stops.at(-1);
      const leaves = last ? last.arrival_time + (byId.get(last.target_id).service_time ?? 0) : 0;
      return leaves + route.return_distance / problem.uavs[i].speed;
    }),
  );
}

/** Every moment at which something happens: arrivals, ends of stays, returns; in order, each once. */
export function moments(problem, answer) {
  const byId = new Map(problem.targets.map((target, j) => [targetId(target, j), target]));
  const all = new Set([0, missionEnd(problem, answer)]);
  for (const route of answer.routes)
    for (const stop of route.stops) {
      all.add(stop.arrival_time);
      all.add(stop.arrival_time + (byId.get(stop.target_id).service_time ?? 0));
    }
  return [...all].sort((a, b) => a - b);
}

/** What one UAV is doing at a moment: where it is, how far it has flown, which stops are behind it. */
export function uavAt(problem, answer, i, time) {
  const uav = problem.uavs[i];
  const route = answer.routes[i];
  const home = [uav.x_s, uav.y_s];
  const byId = new Map(problem.targets.map((target, j) => [targetId(target, j), target]));
  let place = [uav.x_c ?? uav.x_s, uav.y_c ?? uav.y_s];
  let flown = uav.dis ?? 0;
  let leaves = 0;
  for (const [order, stop] of route.stops.entries()) {
    const target = byId.get(stop.target_id);
    const there = [target.x, target.y];
    if (time < stop.arrival_time) {
      const fraction = Math.max(0, (time - leaves) / (stop.arrival_time - leaves));
      return {
        place: between(problem.crs, place, there, fraction),
        flown: flown + fraction * stop.distance,
        done: order,
        doing: fraction > 0 ? "flying" : "waiting",
        next: stop.target_id,
        returning: Boolean(uav.ret),
      };
    }
    flown += stop.distance;
    place = there;
    leaves = stop.arrival_time + (target.service_time ?? 0);
    if (time < leaves)
      return {
        place, flown, done: order + 1, doing: "unloading", next: stop.target_id,
        // With its last stop it is as good as sent home, but a new plan may still have another idea.
        returning: Boolean(uav.ret),
      };
  }
  const done = route.stops.length;
  if (route.return_distance <= 1e-9)
    return { place, flown, done, doing: done ? "home" : "idle", next: null, returning: Boolean(uav.ret) || done > 0 };
  const fraction = Math.min(1, (time - leaves) / (route.return_distance / uav.speed));
  return {
    place: between(problem.crs, place, home, fraction),
    flown: flown + fraction * route.return_distance,
    done,
    doing: fraction < 1 ? "returning" : "home",
    next: null,
    // At the very moment it leaves it can still be given something else.
    returning: Boolean(uav.ret) || fraction > 0,
  };
}

/**
 * The mission at a moment as a problem.
 *
 * Material counts as unloaded on arrival. All times are counted from the moment on. The distance weight is the
 * one that the plan was found with, so that rewards before and after can be compared.
 *
 * @param {object} problem what was allocated
 * @param {object} answer the plan for it
 * @param {number} time from the plan's beginning
 * @param {object} choices lost: ids of UAVs that are out; recall: UAVs that fly home, or are back, may get tasks again
 */
export function problemAt(problem, answer, time, { lost = new Set(), recall = false } = {}) {
  const needs = new Map(problem.targets.map((target, j) => [targetId(target, j), target.loadlist.slice()]));
  const uavs = [];
  problem.uavs.forEach((uav, i) => {
    const now = uavAt(problem, answer, i, time);
    let load = uav.loadlist.slice();
    for (const stop of answer.routes[i].stops.slice(0, now.done)) {
      load = less(load, stop.delivered);
      needs.set(stop.target_id, less(needs.get(stop.target_id), stop.delivered));
    }
    if (lost.has(uavId(uav, i))) return;
    const ret = now.returning && (uav.ret || !recall) ? 1 : 0;
    const visited = new Set(answer.routes[i].stops.slice(0, now.done).map((stop) => stop.target_id));
    uavs.push({
      ...uav, id: uavId(uav, i), x_c: now.place[0], y_c: now.place[1], dis: now.flown, ret, loadlist: load,
      ...(uav.committed ? { committed: uav.committed.filter((id) => !visited.has(id)) } : {}),
      ...(uav.available_from ? { available_from: Math.max(0, uav.available_from - time) } : {}),
      ...(uav.available_until == null ? {} : { available_until: uav.available_until - time }),
    });
  });
  const targets = problem.targets.map((target, j) => {
    const id = targetId(target, j);
    const loadlist = needs.get(id);
    const served = target.requested || loadlist.some((need, k) => need !== target.loadlist[k]);
    return {
      ...target, id, loadlist,
      // What an area asked for at first stays the measure of what it has.
      ...(served ? { requested: requestedBy(target) } : {}),
      ...(target.deadline == null ? {} : { deadline: target.deadline - time }),
      ...(target.earliest ? { earliest: Math.max(0, target.earliest - time) } : {}),
    };
  });
  // The plan to begin from was one of the whole mission, and so is what its changes cost.
  const { start_plan: _plan, ...rest } = problem;
  const { change_weight: _weight, ...objective } = rest.objective ?? {};
  return { ...rest, uavs, targets, objective: { ...objective, distance_weight: answer.distance_weight } };
}

/** An area with other needs than were left: it asked for as much more or less at first. */
export function withNeeds(target, loadlist) {
  if (!target.requested) return { ...target, loadlist };
  return { ...target, loadlist, requested: loadlist.map((need, k) => Math.max(need, target.requested[k] + need - target.loadlist[k])) };
}

/** What is left of a plan after a moment, times counted from there; UAVs that are lost do nothing more,
 * and `dropped` is what they would have done. */
export function remainder(problem, answer, time, lost = new Set()) {
  return answer.routes.map((route, i) => {
    const id = uavId(problem.uavs[i], i);
    const now = uavAt(problem, answer, i, time);
    const dropped = route.stops.slice(now.done);
    if (lost.has(id)) return { uav_id: id, lost: true, stops: [], dropped, distance: 0 };
    const stops = dropped.map((stop) => ({ ...stop, arrival_time: stop.arrival_time - time }));
    const flown = now.flown - (problem.uavs[i].dis ?? 0);
    return { uav_id: id, lost: false, stops, dropped: [], distance: stops.length ? Math.max(0, route.distance - flown) : 0 };
  });
}

/**
 * A new plan beside the rest of the old one.
 *
 * @param {object} now the problem at the moment, as it was allocated again
 * @param {object[]} before what remainder() gives
 * @param {object} answer the new plan
 */
export function changes(now, before, answer) {
  const after = new Map(answer.routes.map((route) => [route.uav_id, route]));
  const routes = before.map((old) => {
    const was = [...old.stops, ...old.dropped].map((stop) => stop.target_id);
    const is = (after.get(old.uav_id)?.stops ?? []).map((stop) => stop.target_id);
    const kind = old.lost ? "lost" : was.join("\n") === is.join("\n") ? "same" : "changed";
    return { uav_id: old.uav_id, before: was, after: is, kind };
  });
  const known = new Set(before.map((old) => old.uav_id));
  for (const route of answer.routes)
    if (!known.has(route.uav_id))
      routes.push({ uav_id: route.uav_id, before: [], after: route.stops.map((stop) => stop.target_id), kind: "new" });
  const given = (list) => {
    const sums = new Map();
    for (const route of list)
      for (const stop of route.stops)
        stop.delivered.forEach((amount, k) => {
          const all = sums.get(stop.target_id) ?? [];
          all[k] = (all[k] ?? 0) + amount;
          sums.set(stop.target_id, all);
        });
    return sums;
  };
  const old = given(before);
  const fresh = given(answer.routes);
  // What is brought, as a share of what was asked for at first; and with what was there before.
  const gain = (target, amounts) => {
    const requested = sum(requestedBy(target));
    return requested > 0 ? target.loadlist.reduce((got, most, k) => got + Math.min(most, amounts?.[k] ?? 0), 0) / requested : 0;
  };
  const share = (target, amounts) => {
    const requested = sum(requestedBy(target));
    return requested > 0 ? 1 - sum(target.loadlist) / requested + gain(target, amounts) : null;
  };
  const areas = now.targets.map((target, j) => ({
    target_id: targetId(target, j),
    before: share(target, old.get(targetId(target, j))),
    after: share(target, fresh.get(targetId(target, j))),
  }));
  const satisfaction = now.targets.reduce((total, target, j) => total + target.level * gain(target, old.get(targetId(target, j))), 0);
  const flown = before.reduce((sum, route) => sum + route.distance, 0);
  return { routes, areas, kept: { satisfaction, distance: flown, reward: satisfaction - answer.distance_weight * flown } };
}
