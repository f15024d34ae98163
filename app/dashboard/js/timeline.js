/** A timeline a UAV: its legs, where it waits, what it does at its stops, and the way home. */

import { paint } from "./colours.js";
import { h, shortAmounts, shown } from "./dom.js";
import { called, names, waiting } from "./plan.js";
import { Portions } from "./portions.js";
import { select } from "./state.js";

/**
 * Draw the timelines of an answer.
 * @param {object} problem
 * @param {object} answer
 * @returns {{element: HTMLElement | null, portions: Portions | null}} null where nobody flies
 */
export function timeline(problem, answer) {
  const targets = new Map(problem.targets.map((target) => [target.id, target]));
  const rows = problem.uavs.map((uav, index) => ({ uav, ...timesOf(uav, answer.routes[index], targets) })).filter(({ stops }) => stops.length);
  const nameOf = names(problem.targets);
  const end = Math.max(0, ...rows.map(({ home }) => home)) || 1;
  const share = (time) => `${(100 * time) / end}%`;
  const bar = (kind, from, to, title) => {
    const made = h("span", { class: kind, title });
    made.style.left = share(from);
    made.style.width = share(to - from);
    return made;
  };
  const row = ({ uav, stops, home }) => {
    const track = paint(h("div", { class: "track" }), uav.id);
    stops.forEach((stop, n) => {
      const name = nameOf(stop.id);
      const { waits } = stop;
      if (waits) track.append(bar("wait", waits.from, waits.to, `waits for ${name} ${waits.onGround ? "on the ground" : "in the air"} until ${shown(waits.to)}`));
      track.append(bar("leg", stop.left, stop.arrival, `to ${name}`));
      const at = bar("visit", stop.begin, stop.done, `${n + 1}. ${name} at ${shown(stop.begin)}: ${shortAmounts(stop.delivered)}`);
      at.dataset.targetId = stop.id;
      track.append(at);
    });
    if (home > stops.at(-1).done) track.append(bar("leg home", stops.at(-1).done, home, `home at ${shown(home)}`));
    return h("li", { dataset: { uavId: uav.id } }, h("button", { type: "button", class: "quiet", title: uav.id, onclick: () => select({ kind: "uavs", id: uav.id }) }, called(uav)), track);
  };
  const ticks = h("li", { class: "ticks", "aria-hidden": "true" }, h("span", {}, problem.crs === "wgs84" ? "hours" : "time"), h("div", { class: "track" }, [0, 0.25, 0.5, 0.75, 1].map((part) => {
    const tick = h("span", { class: "tick" }, shown(part * end, 3));
    tick.style.left = `${100 * part}%`;
    return tick;
  })));
  if (!rows.length) return { element: null, portions: null };
  const element = h("ol", { class: "timeline", "aria-label": "Timeline of each UAV" }, ticks);
  return { element, portions: new Portions(element, rows, row, (button) => h("li", {}, button)) };
}

/** When a UAV leaves for each stop, arrives, begins and is done there, when it waits, and when it is home. */
function timesOf(uav, route, targets) {
  let left = uav.available_from ?? 0;
  const stops = route.stops.map((stop, n) => {
    const arrival = stop.arrival_time;
    const begin = stop.begin_time ?? arrival;
    const done = stop.departure_time ?? arrival + (targets.get(stop.target_id).service_time ?? 0);
    const { time, onGround } = waiting(uav, stop, n);
    const times = { id: stop.target_id, left, arrival, begin, done, delivered: stop.delivered, waits: null };
    if (time > 0 && onGround) Object.assign(times, { left: left + time, arrival: begin, waits: { from: left, to: left + time, onGround } });
    else if (time > 0) times.waits = { from: arrival, to: begin, onGround };
    left = done;
    return times;
  });
  return { stops, home: route.landing?.time ?? left + route.return_distance / uav.speed };
}
