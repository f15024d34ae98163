/** A timeline a UAV: its legs, where it waits, what it does at its stops, turnarounds at bases, and the way home. */

import { paint } from "./colours.js";
import { h, shortAmounts, shown } from "./dom.js";
import { called, placeNames } from "./plan.js";
import { Portions } from "./portions.js";
import { select } from "./state.js";
import { baseOf } from "./stops.js";
import { allTimes } from "./times.js";

/**
 * Draw the timelines of an answer.
 * @param {object} problem
 * @param {object} answer
 * @returns {{element: HTMLElement | null, portions: Portions | null}} null where nobody flies
 */
export function timeline(problem, answer) {
  const times = allTimes(problem, answer);
  const rows = problem.uavs.map((uav, index) => ({ uav, ...times[index] })).filter(({ stops }) => stops.length);
  const nameOf = placeNames(problem);
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
      track.append(bar("leg", stop.left, stop.arrival, stops.some(({ loaded }) => loaded) ? `flight ${stop.flight}, to ${name}` : `to ${name}`));
      if (stop.loaded) {
        const at = bar("turnaround", stop.begin, stop.done, `${n + 1}. ${name} at ${shown(stop.begin)}: loads ${shortAmounts(stop.loaded)}, takes off from ${shown(stop.done)}`);
        at.dataset.baseId = baseOf(stop.id);
        track.append(at);
        return;
      }
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
