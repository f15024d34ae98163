/** What the UAVs of a mission do at its clock: from its state and the plan in force, as the service says them. */

import { stateOf } from "../plan.js";
import { isReload, placeOf } from "../stops.js";
import { t } from "../texts.js";
import { timesOf } from "../times.js";
import { momentText } from "../units.js";

/** The problem of a state as it is drawn: UAVs are where they were seen since, and those that are lost are out. */
export function asSeen(state, positions, stateNumber) {
  const lost = new Set(state.lost);
  const moved = (uav) => {
    const seen = positions[uav.id];
    return seen && seen.number > stateNumber ? { ...uav, x_c: seen.x, y_c: seen.y } : uav;
  };
  return { ...state.problem, uavs: state.problem.uavs.filter(({ id }) => !lost.has(id)).map(moved) };
}

/**
 * What a UAV does, in words.
 * @param {object} uav of the state's problem
 * @param {object} route of the plan in force
 * @param {object} state
 * @param {(place: string) => string} nameOf what places are called
 */
export function doing(uav, route, state, nameOf) {
  if (state.lost.includes(uav.id)) return t("lost");
  const { clock } = state;
  const aloft = stateOf(uav) !== "at its base";
  const last = state.done.findLast((each) => each.uav_id === uav.id);
  const at = (time) => momentText(state.problem, time);
  if ((uav.available_from ?? 0) > clock) {
    const until = at(uav.available_from);
    if (!last) return t("waits until {until}", { until });
    const place = nameOf(placeOf(last.base_id ? { kind: "reload", base_id: last.base_id } : last));
    return last.base_id ? t("reloads at {place} until {until}", { place, until }) : t("at {place} until {until}", { place, until });
  }
  const [next] = route?.stops ?? [];
  if (next) {
    const { stops: [first] } = timesOf(uav, route, new Map(state.problem.targets.map((target) => [target.id, target])));
    const place = nameOf(first.id);
    if (first.waits?.onGround) return t("takes off at {time} to {place}", { time: at(first.left), place });
    return t("to {place}, there at {time}", { place, time: at(first.arrival) });
  }
  if (uav.ret) return t("flies home");
  if (aloft && (route?.landing?.time ?? clock) > clock) return t("flies home, there at {time}", { time: at(route.landing.time) });
  return aloft ? t("has landed") : t("at its base");
}

/** Stops of the plan in force in the order of time. @returns {{uav: object, stop: object, place: string, begin: number}[]} */
export function stopsAhead(problem, plan) {
  const uavs = new Map(problem.uavs.map((uav) => [uav.id, uav]));
  return plan.routes
    .flatMap((route) => route.stops.map((stop) => ({ uav: uavs.get(route.uav_id), stop, place: placeOf(stop), begin: isReload(stop) ? stop.arrival_time : (stop.begin_time ?? stop.arrival_time) })))
    .filter(({ uav }) => uav)
    .sort((a, b) => a.begin - b.begin);
}

/** What a plan brings to each area. @returns {Map<string, number[]>} amounts by target id */
export function brought(plan) {
  const all = new Map();
  for (const { stops } of plan.routes) {
    for (const stop of stops) {
      if (isReload(stop)) continue;
      const before = all.get(stop.target_id);
      all.set(stop.target_id, stop.delivered.map((amount, k) => amount + (before?.[k] ?? 0)));
    }
  }
  return all;
}

