/** When the UAVs of a plan do what, by the answer's own times. */

import { waiting } from "./plan.js";
import { flightsOf, isReload, placeOf } from "./stops.js";

/** When a UAV leaves for each stop, arrives, begins and is done there, when it waits, and when it is home. */
export function timesOf(uav, route, targets) {
  let left = uav.available_from ?? 0;
  const flights = flightsOf(route);
  const stops = route.stops.map((stop, n) => {
    const arrival = stop.arrival_time;
    const begin = stop.begin_time ?? arrival;
    const done = stop.departure_time ?? arrival + (targets.get(stop.target_id).service_time ?? 0);
    const { time, onGround } = waiting(uav, route.stops, n);
    const times = { id: placeOf(stop), left, arrival, begin, done, delivered: stop.delivered, waits: null, flight: flights[n], ...(isReload(stop) ? { loaded: stop.loaded } : {}) };
    if (time > 0 && onGround) Object.assign(times, { left: left + time, arrival: begin, waits: { from: left, to: left + time, onGround } });
    else if (time > 0) times.waits = { from: arrival, to: begin, onGround };
    left = done;
    return times;
  });
  return { stops, home: route.landing?.time ?? left + route.return_distance / uav.speed };
}

/** The same of every UAV of a problem. */
export function allTimes(problem, answer) {
  const targets = new Map(problem.targets.map((target) => [target.id, target]));
  return problem.uavs.map((uav, i) => timesOf(uav, answer.routes[i], targets));
}

/** From when to when a plan goes, and every moment at which something happens, in order, each once. */
export function course(problem, times) {
  const flying = problem.uavs.filter((uav) => !uav.ret);
  const begin = flying.length ? Math.min(...flying.map((uav) => uav.available_from ?? 0)) : 0;
  const all = new Set([begin]);
  for (const { stops, home } of times) {
    for (const { arrival, begin: begins, done, waits } of stops) for (const at of [waits && !waits.onGround ? waits.from : arrival, begins, done]) all.add(at);
    if (home > begin) all.add(home);
  }
  const moments = [...all].filter((at) => at >= begin).sort((a, b) => a - b);
  return { begin, end: moments.at(-1), moments };
}
