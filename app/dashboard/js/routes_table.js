/** The routes of an answer as a table: when each visit is, what it unloads, and whether the next allocation keeps it. */

import { paint } from "./colours.js";
import { h, svg } from "./dom.js";
import { lockedCount, lockFirst } from "./locks.js";
import { amountsCell, amountsHead } from "./materials.js";
import { called, placeNames, waiting } from "./plan.js";
import { Portions } from "./portions.js";
import { get, select } from "./state.js";
import { atBase, flightsOf, isReload, placeOf } from "./stops.js";
import { listed, t, tn, tNodes } from "./texts.js";
import { durationText, length, moment } from "./units.js";

const COLUMNS = "5";
const SHACKLE = { open: "M8 11V7a4 4 0 0 1 7.5-2", shut: "M8 11V7a4 4 0 0 1 8 0v4" };

/**
 * @param {object} problem
 * @param {object} answer
 * @param {object[]} wanted those of its routes that are shown, in order
 * @param {(text: string) => void} tell is told what locking has done
 * @returns {{element: HTMLElement, portions: Portions | null, markLocks: () => void}}
 */
export function routesTable(problem, answer, wanted, tell) {
  const head = ["#", problem.bases?.length ? t("Where") : t("Area"), t("Arrives"), amountsHead(problem, t("Unloads"))];
  const flying = answer.routes.filter((route) => route.stops.length).length;
  if (!flying) return { element: h("p", { class: "card", id: "nobody-flies" }, t("Nobody flies: no visit is possible, or none is worth its distance.")), portions: null, markLocks: () => {} };
  const body = h("tbody", {});
  const uavs = new Map(problem.uavs.map((uav) => [uav.id, uav]));
  const nameOf = placeNames(problem);
  const markLocks = () => {
    const now = new Map(get().problem.uavs.map((uav) => [uav.id, uav]));
    const visits = new Map(wanted.map((route) => [route.uav_id, route.stops.map(placeOf)]));
    for (const button of body.querySelectorAll("button.lock")) {
      const { uavId, at } = button.dataset;
      const locked = Number(at) < lockedCount(now.get(uavId), visits.get(uavId));
      button.setAttribute("aria-pressed", String(locked));
      button.title = locked ? t("Unlock this visit") : t("Lock this visit: the next allocation keeps it");
      button.disabled = !now.has(uavId);
      button.querySelector("path").setAttribute("d", SHACKLE[locked ? "shut" : "open"]);
      button.closest("tr").classList.toggle("locked", locked);
    }
  };
  const portions = new Portions(body, wanted, (route) => routeRows(problem, uavs.get(route.uav_id), route, nameOf, tell), (button) => h("tr", {}, h("td", { colspan: COLUMNS }, button)));
  new MutationObserver(markLocks).observe(body, { childList: true });
  markLocks();
  const counts = { flying, uavs: problem.uavs.length };
  const element = h("details", { open: true }, h("summary", {}, wanted.length < flying ? t("Routes of {flying} of {uavs} UAVs, {shown} shown", { ...counts, shown: wanted.length }) : t("Routes of {flying} of {uavs} UAVs", counts)),
    h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": t("Routes") }, h("table", { id: "routes" }, h("thead", {}, h("tr", {}, head.map((title, at) => h("th", { scope: "col", class: [0, 2, 3].includes(at) ? "num" : null }, title)), h("td", {}))), body)));
  return { element, portions, markLocks };
}

function routeRows(problem, uav, route, nameOf, tell) {
  const flights = flightsOf(route);
  const reloads = route.stops.findIndex(isReload);
  return [
    headRow(problem, uav, route, nameOf, reloads >= 0 && flights.at(-1) + Number(isReload(route.stops.at(-1)) && route.return_distance > 0)),
    ...route.stops.map((stop, n) => {
      if (isReload(stop)) return reloadRow(problem, route, stop, n, nameOf);
      return h("tr", { dataset: { uavId: route.uav_id, targetId: stop.target_id, step: stop.step, flight: flights[n] } },
        h("td", { class: "num" }, String(n + 1)), h("td", { class: "area", title: stop.target_id }, nameOf(stop.target_id)), h("td", { class: "num" }, moment(problem, stop.arrival_time), waitHint(problem, uav, route.stops, n)),
        h("td", { class: "num" }, amountsCell(problem, stop.delivered)), h("td", {}, (reloads < 0 || n < reloads) && lockButton(uav, route, n, nameOf, tell)));
    }),
  ];
}

/** The UAV of the rows below, and how far it flies. @param {number | false} flights how many, where that is said */
function headRow(problem, uav, route, nameOf, flights) {
  const key = paint(h("span", { class: "key", "aria-hidden": "true" }), route.uav_id);
  return h("tr", { class: "head" }, h("th", { scope: "rowgroup", colspan: COLUMNS },
    h("button", { type: "button", class: "quiet", title: route.uav_id, onclick: () => select({ kind: "uavs", id: route.uav_id }) }, key, called(uav)),
    h("span", { class: "hint" }, wayOf(problem, route, nameOf)), flights && h("span", { class: "hint" }, tn(flights, "{count} flight", "{count} flights"))));
}

/** A stop at a base, which ends a flight. What comes after it cannot be locked: commitments come before all reloads. */
function reloadRow(problem, route, stop, n, nameOf) {
  return h("tr", { class: "reload", dataset: { uavId: route.uav_id, baseId: stop.base_id, step: stop.step } },
    h("td", { class: "num" }, String(n + 1)), h("td", { class: "area", title: stop.base_id }, nameOf(placeOf(stop))),
    h("td", { class: "num" }, moment(problem, stop.arrival_time), h("p", { class: "hint" }, tNodes("flies on from {time}", { time: moment(problem, stop.departure_time) }))),
    h("td", { class: "num" }, tNodes("loads {amounts}", { amounts: h("span", {}, amountsCell(problem, stop.loaded)) })), h("td", {}));
}

/** How long a route is, and where it ends. */
function wayOf(problem, route, nameOf) {
  const ways = { out: length(problem, route.distance, 3), home: length(problem, route.return_distance, 3) };
  if (!route.landing?.base_id) return tNodes("{out} + {home} home", ways);
  return tNodes("{out} + {home} to {base}", { ...ways, base: nameOf(atBase(route.landing.base_id)) });
}

/** What stands beside an arrival where the visit begins later. */
function waitHint(problem, uav, stops, n) {
  const { time, onGround } = waiting(uav, stops, n);
  if (!(time > 0)) return null;
  const facts = { duration: durationText(problem, time), begin: moment(problem, stops[n].begin_time) };
  return h("p", { class: "hint" }, onGround ? tNodes("waits {duration} on the ground, begins {begin}", facts) : tNodes("waits {duration}, begins {begin}", facts));
}

function lockedToo(areas) {
  return tn(areas.length, "{areas} is locked too: what is locked comes first, in order.", "{areas} are locked too: what is locked comes first, in order.", { areas: listed(areas) });
}

function unlockedToo(areas) {
  return tn(areas.length, "{areas} is unlocked too: what is locked comes first.", "{areas} are unlocked too: what is locked comes first.", { areas: listed(areas) });
}

function lockButton(uav, route, n, nameOf, tell) {
  const visits = route.stops.map(placeOf);
  const name = nameOf(visits[n]);
  const act = () => {
    const count = lockedCount(get().problem.uavs.find(({ id }) => id === uav.id), visits);
    const lock = n >= count;
    const others = (lock ? visits.slice(count, n) : visits.slice(n + 1, count)).map(nameOf);
    lockFirst(uav.id, visits, lock ? n + 1 : n);
    const facts = { uav: called(uav), area: name };
    const says = lock ? t("{uav} visits {area} in the next plan too.", facts) : t("The next plan of {uav} need not visit {area}.", facts);
    tell([says, ...(others.length ? [lock ? lockedToo(others) : unlockedToo(others)] : [])].join(" "));
  };
  return h("button", { type: "button", class: "quiet lock", "aria-label": t("Lock visit {number} of {uav}, {area}", { number: n + 1, uav: called(uav), area: name }), dataset: { uavId: uav.id, at: n }, onclick: act },
    svg("svg", { viewBox: "0 0 24 24", width: 16, height: 16, "aria-hidden": "true" }, svg("rect", { x: 5, y: 11, width: 14, height: 9, rx: 2 }), svg("path", { d: SHACKLE.open })));
}
