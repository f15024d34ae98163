/** A timeline a UAV: its legs, where it waits, what it does at its stops, turnarounds at bases, and the way home. */

import { paint } from "./colours.js";
import { h } from "./dom.js";
import { amountsText } from "./materials.js";
import { called, placeNames } from "./plan.js";
import { Portions } from "./portions.js";
import { select } from "./state.js";
import { baseOf } from "./stops.js";
import { t } from "./texts.js";
import { allTimes } from "./times.js";
import { momentText, roundMoments } from "./units.js";

/**
 * Draw the timelines of an answer.
 * @param {object} problem
 * @param {object} answer
 * @param {object[]} [routes] those of its routes that are shown, in order
 * @returns {{element: HTMLElement | null, portions: Portions | null}} null where nobody flies
 */
export function timeline(problem, answer, routes = answer.routes) {
  const times = allTimes(problem, answer);
  const all = new Map(problem.uavs.map((uav, index) => [uav.id, { uav, ...times[index] }]));
  const flying = [...all.values()].filter(({ stops }) => stops.length);
  const rows = routes.map(({ uav_id: id }) => all.get(id)).filter(({ stops }) => stops.length);
  const nameOf = placeNames(problem);
  const end = Math.max(0, ...flying.map(({ home }) => home)) || 1;
  const share = (time) => `${(100 * time) / end}%`;
  const at = (time) => momentText(problem, time);
  const bar = (kind, from, to, title) => {
    const made = h("span", { class: kind, title });
    made.style.left = share(from);
    made.style.width = share(to - from);
    return made;
  };
  const row = ({ uav, stops, home }) => {
    const track = paint(h("div", { class: "track" }), uav.id);
    stops.forEach((stop, n) => {
      const place = nameOf(stop.id);
      const { waits } = stop;
      if (waits) {
        const facts = { place, time: at(waits.to) };
        track.append(bar("wait", waits.from, waits.to, waits.onGround ? t("waits for {place} on the ground until {time}", facts) : t("waits for {place} in the air until {time}", facts)));
      }
      const leg = stops.some(({ loaded }) => loaded) ? t("flight {flight}, to {place}", { flight: stop.flight, place }) : t("to {place}", { place });
      track.append(bar("leg", stop.left, stop.arrival, leg));
      const facts = { number: n + 1, place, begin: at(stop.begin), end: at(stop.done), amounts: amountsText(problem, stop.loaded ?? stop.delivered) };
      const made = stop.loaded
        ? bar("turnaround", stop.begin, stop.done, t("{number}. {place} at {begin}: loads {amounts}, takes off from {end}", facts))
        : bar("visit", stop.begin, stop.done, t("{number}. {place} at {begin}: {amounts}", facts));
      if (stop.loaded) made.dataset.baseId = baseOf(stop.id);
      else made.dataset.targetId = stop.id;
      track.append(made);
    });
    if (home > stops.at(-1).done) track.append(bar("leg home", stops.at(-1).done, home, t("home at {time}", { time: at(home) })));
    return h("li", { dataset: { uavId: uav.id } }, h("button", { type: "button", class: "quiet", title: uav.id, onclick: () => select({ kind: "uavs", id: uav.id }) }, called(uav)), track);
  };
  const ticks = h("li", { class: "ticks", "aria-hidden": "true" }, h("span", {}), h("div", { class: "track" }, roundMoments(problem, end).map((time) => {
    const tick = h("span", { class: "tick" }, at(time));
    tick.style.left = share(time);
    return tick;
  })));
  if (!flying.length) return { element: null, portions: null };
  const element = h("ol", { class: "timeline", "aria-label": t("Timeline of each UAV") }, ticks);
  return { element, portions: new Portions(element, rows, row, (button) => h("li", {}, button)) };
}
