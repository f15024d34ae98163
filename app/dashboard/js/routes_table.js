/** The routes of an answer as a table: when each visit is, what it unloads, and whether the next allocation keeps it. */

import { paint } from "./colours.js";
import { amounts, h, number, svg } from "./dom.js";
import { lockedCount, lockFirst } from "./locks.js";
import { called, placeNames, waiting } from "./plan.js";
import { Portions } from "./portions.js";
import { get, select } from "./state.js";
import { atBase, flightsOf, isReload, placeOf } from "./stops.js";

const SHACKLE = { open: "M8 11V7a4 4 0 0 1 7.5-2", shut: "M8 11V7a4 4 0 0 1 8 0v4" };

/**
 * @param {object} problem
 * @param {object} answer
 * @param {(text: string) => void} tell is told what locking has done
 * @returns {{element: HTMLElement, portions: Portions | null, markLocks: () => void}}
 */
export function routesTable(problem, answer, tell) {
  const head = ["UAV", "#", problem.bases?.length ? "Where" : "Area", problem.crs === "wgs84" ? "Arrives, h" : "Arrives", "Unloads"];
  const out = answer.routes.filter((route) => route.stops.length);
  if (!out.length) return { element: h("p", { class: "card", id: "nobody-flies" }, "Nobody flies: no visit is possible, or none is worth its distance."), portions: null, markLocks: () => {} };
  const body = h("tbody", {});
  const uavs = new Map(problem.uavs.map((uav) => [uav.id, uav]));
  const nameOf = placeNames(problem);
  const markLocks = () => {
    const now = new Map(get().problem.uavs.map((uav) => [uav.id, uav]));
    const visits = new Map(out.map((route) => [route.uav_id, route.stops.map(placeOf)]));
    for (const button of body.querySelectorAll("button.lock")) {
      const { uavId, at } = button.dataset;
      const locked = Number(at) < lockedCount(now.get(uavId), visits.get(uavId));
      button.setAttribute("aria-pressed", String(locked));
      button.title = locked ? "Unlock this visit" : "Lock this visit: the next allocation keeps it";
      button.disabled = !now.has(uavId);
      button.querySelector("path").setAttribute("d", SHACKLE[locked ? "shut" : "open"]);
      button.closest("tr").classList.toggle("locked", locked);
    }
  };
  const portions = new Portions(body, out, (route) => routeRows(uavs.get(route.uav_id), route, nameOf, tell), (button) => h("tr", {}, h("td", { colspan: "6" }, button)));
  new MutationObserver(markLocks).observe(body, { childList: true });
  markLocks();
  const element = h("details", { open: true }, h("summary", {}, `Routes of ${out.length} of ${problem.uavs.length} UAVs`),
    h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": "Routes" }, h("table", { id: "routes" }, h("thead", {}, h("tr", {}, head.map((title, at) => h("th", { scope: "col", class: [1, 3, 4].includes(at) ? "num" : null }, title)), h("td", {}))), body)));
  return { element, portions, markLocks };
}

function routeRows(uav, route, nameOf, tell) {
  const flights = flightsOf(route);
  const reloads = route.stops.findIndex(isReload);
  return route.stops.map((stop, n) => {
    const key = paint(h("span", { class: "key", "aria-hidden": "true" }), route.uav_id);
    const first = n === 0 ? h("th", { scope: "rowgroup", rowspan: String(route.stops.length) }, h("button", { type: "button", class: "quiet", title: route.uav_id, onclick: () => select({ kind: "uavs", id: route.uav_id }) }, key, called(uav)), h("p", { class: "hint" }, number(route.distance, 3), " + ", number(route.return_distance, 3), route.landing?.base_id ? ` to ${nameOf(atBase(route.landing.base_id))}` : " home"), reloads >= 0 && h("p", { class: "hint" }, `${flights.at(-1) + Number(isReload(route.stops.at(-1)) && route.return_distance > 0)} flights`)) : null;
    if (isReload(stop)) return reloadRow(route, stop, n, first, nameOf);
    return h("tr", { dataset: { uavId: route.uav_id, targetId: stop.target_id, step: stop.step, flight: flights[n] } }, first,
      h("td", { class: "num" }, String(n + 1)), h("td", { class: "area", title: stop.target_id }, nameOf(stop.target_id)), h("td", { class: "num" }, number(stop.arrival_time), waitHint(uav, route.stops, n)),
      h("td", { class: "num" }, amounts(stop.delivered)), h("td", {}, (reloads < 0 || n < reloads) && lockButton(uav, route, n, nameOf, tell)));
  });
}

/** A stop at a base, which ends a flight. What comes after it cannot be locked: commitments come before all reloads. */
function reloadRow(route, stop, n, first, nameOf) {
  return h("tr", { class: "reload", dataset: { uavId: route.uav_id, baseId: stop.base_id, step: stop.step } }, first,
    h("td", { class: "num" }, String(n + 1)), h("td", { class: "area", title: stop.base_id }, nameOf(placeOf(stop))),
    h("td", { class: "num" }, number(stop.arrival_time), h("p", { class: "hint" }, "flies on from ", number(stop.departure_time))),
    h("td", { class: "num" }, "loads ", amounts(stop.loaded)), h("td", {}));
}

/** What stands beside an arrival where the visit begins later. */
function waitHint(uav, stops, n) {
  const { time, onGround } = waiting(uav, stops, n);
  return time > 0 ? h("p", { class: "hint" }, "waits ", number(time), onGround ? " on the ground, begins " : ", begins ", number(stops[n].begin_time)) : null;
}

function lockButton(uav, route, n, nameOf, tell) {
  const visits = route.stops.map(placeOf);
  const name = nameOf(visits[n]);
  const act = () => {
    const count = lockedCount(get().problem.uavs.find(({ id }) => id === uav.id), visits);
    const lock = n >= count;
    const others = (lock ? visits.slice(count, n) : visits.slice(n + 1, count)).map(nameOf);
    lockFirst(uav.id, visits, lock ? n + 1 : n);
    const too = others.length ? ` ${others.join(", ")} ${others.length === 1 ? "is" : "are"} ${lock ? "locked too: what is locked comes first, in order" : "unlocked too: what is locked comes first"}.` : "";
    tell(lock ? `${called(uav)} visits ${name} in the next plan too.${too}` : `The next plan of ${called(uav)} need not visit ${name}.${too}`);
  };
  return h("button", { type: "button", class: "quiet lock", "aria-label": `Lock visit ${n + 1} of ${called(uav)}, ${name}`, dataset: { uavId: uav.id, at: n }, onclick: act },
    svg("svg", { viewBox: "0 0 24 24", width: 16, height: 16, "aria-hidden": "true" }, svg("rect", { x: 5, y: 11, width: 14, height: 9, rx: 2 }), svg("path", { d: SHACKLE.open })));
}
