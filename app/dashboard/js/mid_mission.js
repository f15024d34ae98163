/**
 * The state of a mission at a moment of its plan, as a problem that can be allocated again (x_c, y_c, dis, ret,
 * what is still carried and needed), and what a new plan changes against the old one. No page, no requests.
 */

import { idOf } from "./kinds.js";
import { sum, waiting } from "./plan.js";
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

/** Where somebody is on a way, a share of its length after its first point, and the points from there on. */
function onWay(crs, points, fraction) {
  if (points.length === 2) {
    const place = between(crs, ...points, fraction);
    return { place, ahead: [place, points[1]] };
  }
  const lengths = points.slice(1).map((point, k) => distance(crs, points[k], point));
  let left = Math.min(1, Math.max(0, fraction)) * sum(lengths);
  for (const [k, length] of lengths.entries()) {
    if (left < length || k === lengths.length - 1) {
      const place = between(crs, points[k], points[k + 1], length > 0 ? left / length : 1);
      return { place, ahead: [place, ...points.slice(k + 1)] };
    }
    left -= length;
  }
  return { place: points[0], ahead: points };
}

/** When a visit of a stop begins and has ended; an answer to a problem without a world has the arrival alone. */
function timesOf(stop, target) {
  return { begins: stop.begin_time ?? stop.arrival_time, leaves: stop.departure_time ?? stop.arrival_time + (target.service_time ?? 0) };
}

/** When a UAV has landed, if its last visit has ended at a time. */
function lands(uav, route, leaves) {
  return route.landing?.time ?? leaves + route.return_distance / uav.speed;
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
      if (!last && !route.return_distance) return 0;
      const leaves = last ? timesOf(last, byId.get(last.target_id)).leaves : (problem.uavs[i].available_from ?? 0);
      return lands(problem.uavs[i], route, leaves);
    }),
  );
}

/** Every moment at which something happens: arrivals, ends of stays, returns; in order, each once. */
export function moments(problem, answer) {
  const byId = new Map(problem.targets.map((target, j) => [targetId(target, j), target]));
  const all = new Set([0, missionEnd(problem, answer)]);
  for (const route of answer.routes)
    for (const stop of route.stops) {
      const { begins, leaves } = timesOf(stop, byId.get(stop.target_id));
      for (const at of [stop.arrival_time, begins, leaves]) all.add(at);
    }
  return [...all].sort((a, b) => a - b);
}

/**
 * What one UAV is doing at a moment: where it is, how far it has flown, since when it is in the air, which stops are
 * behind it, and what is left of the way that it is on.
 */
export function uavAt(problem, answer, i, time) {
  const uav = problem.uavs[i];
  const route = answer.routes[i];
  const home = [uav.x_s, uav.y_s];
  const byId = new Map(problem.targets.map((target, j) => [targetId(target, j), target]));
  let place = [uav.x_c ?? uav.x_s, uav.y_c ?? uav.y_s];
  let flown = uav.dis ?? 0;
  let leaves = uav.available_from ?? 0;
  let rangeLeft = uav.voyage - flown;
  const tookOff = leaves + (route.stops.length ? waitOnGround(uav, route.stops[0]) : 0);
  for (const [order, stop] of route.stops.entries()) {
    const target = byId.get(stop.target_id);
    const there = [target.x, target.y];
    const onGround = order === 0 ? waitOnGround(uav, stop) : 0;
    const [starts, arrives] = [leaves + onGround, stop.arrival_time + onGround];
    const times = timesOf(stop, target);
    // What range counts is longer than the way against the wind.
    const length = stop.range_left === undefined ? stop.distance : rangeLeft - stop.range_left;
    if (time < arrives) {
      const fraction = Math.max(0, (time - starts) / (arrives - starts));
      const { place: now, ahead } = onWay(problem.crs, stop.path ?? [place, there], fraction);
      return {
        place: now,
        ahead,
        flown: flown + fraction * length,
        tookOff,
        done: order,
        doing: fraction > 0 ? "flying" : "waiting",
        next: stop.target_id,
        returning: Boolean(uav.ret),
      };
    }
    flown += length;
    rangeLeft = stop.range_left;
    place = there;
    leaves = times.leaves;
    if (time < times.begins) return { place, flown, tookOff, done: order, doing: "waiting", next: stop.target_id, returning: Boolean(uav.ret) };
    if (time < leaves)
      return {
        place, flown, tookOff, done: order + 1, doing: "unloading", next: stop.target_id,
        // With its last stop it is as good as sent home, but a new plan may still have another idea.
        returning: Boolean(uav.ret),
      };
  }
  const done = route.stops.length;
  if (route.return_distance <= 1e-9)
    return { place, flown, tookOff, done, doing: done ? "home" : "idle", next: null, returning: Boolean(uav.ret) || done > 0 };
  // Who need not return is done where its last visit has ended.
  if (route.landing !== undefined && problem.objective?.return_to_base === false)
    return { place, flown, tookOff, done, doing: done ? "landed" : "idle", next: null, returning: Boolean(uav.ret) || done > 0 };
  const flight = lands(uav, route, leaves) - leaves;
  const fraction = Math.max(0, Math.min(1, (time - leaves) / flight));
  return {
    place: onWay(problem.crs, route.landing?.path ?? [place, home], fraction).place,
    flown: flown + fraction * (problem.wind ? flight * uav.speed : route.return_distance),
    tookOff,
    done,
    doing: fraction < 1 ? "returning" : "home",
    next: null,
    // At the very moment it leaves it can still be given something else.
    returning: Boolean(uav.ret) || fraction > 0,
  };
}

/** How long a UAV waits for its first visit before it takes off. */
function waitOnGround(uav, stop) {
  const { time, onGround } = waiting(uav, stop, 0);
  return onGround ? time : 0;
}

/**
 * The mission at a moment as a problem.
 *
 * Material counts as unloaded when a visit begins. All times are counted from the moment on. The distance weight is
 * the one that the plan was found with, so that rewards before and after can be compared.
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
      ...(uav.endurance == null ? {} : { airborne: (uav.airborne ?? 0) + Math.max(0, time - now.tookOff) }),
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
    const shifted = (stop) => Object.fromEntries(["begin_time", "departure_time"].filter((name) => name in stop).map((name) => [name, stop[name] - time]));
    const stops = dropped.map((stop) => ({ ...stop, arrival_time: stop.arrival_time - time, ...shifted(stop) }));
    if (stops.length && stops[0].path) stops[0] = { ...stops[0], path: now.ahead ?? null };
    const landing = route.landing && { ...route.landing, time: route.landing.time - time };
    const flown = now.flown - (problem.uavs[i].dis ?? 0);
    return { uav_id: id, lost: false, stops, dropped: [], ...(landing === undefined ? {} : { landing }), distance: stops.length ? Math.max(0, route.distance - flown) : 0 };
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
