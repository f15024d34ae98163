/** What remains of a mission, in tables: UAVs, stops that are planned and done, areas, bases. */

import { stockText } from "../bases.js";
import { h, number } from "../dom.js";
import { BASES } from "../kinds.js";
import { amountsCell, amountsText, materialNames, numbersText } from "../materials.js";
import { baseName, called, placeNames, rangeLeft } from "../plan.js";
import { select } from "../state.js";
import { isReload } from "../stops.js";
import { t, tNodes } from "../texts.js";
import { durationText, length, moment } from "../units.js";
import { brought, doing, stopsAhead } from "./doing.js";
import { LiveTable } from "./live_table.js";

function nameCell(kind, item, chosen) {
  return h("th", { scope: "row", title: item.id }, h("button", { type: "button", class: "quiet", onclick: () => { select({ kind, id: item.id }); chosen?.(); } }, called(item)));
}

/** UAVs: what each does, what it has left and aboard, when it was seen last. */
function uavs(chosen) {
  const table = new LiveTable("UAVs", t("UAVs"), [[t("UAV")], [t("Doing")], [t("Range left"), true], [t("Load"), true], [t("Seen"), true]]);
  const draw = ({ state, plan }, positions) => {
    const nameOf = placeNames(state.problem);
    const routes = new Map(plan.routes.map((route) => [route.uav_id, route]));
    table.show(state.problem.uavs, (uav) => {
      const lost = state.lost.includes(uav.id);
      return h("tr", { class: lost ? "lost" : null, dataset: { uav: uav.id } }, nameCell("uavs", uav, chosen), h("td", { class: "wide" }, doing(uav, routes.get(uav.id), state, nameOf)),
        h("td", { class: "n" }, lost ? "–" : length(state.problem, rangeLeft(uav))), h("td", { class: "n load" }, lost ? "–" : materialNames(state.problem) ? amountsText(state.problem, uav.loadlist) : numbersText(uav.loadlist, " · ")),
        h("td", { class: "n" }, positions[uav.id] ? moment(state.problem, positions[uav.id].time) : "–"));
    });
  };
  return { title: t("UAVs"), open: true, table, draw };
}

/** Stops of the plan in force, the next one first. */
function ahead(tellOf) {
  const table = new LiveTable("stops ahead", t("Stops ahead"), [[t("At"), true], [t("UAV")], [t("Stops at")], [t("Brings"), true], [""]]);
  const draw = ({ state, plan }) => {
    const nameOf = placeNames(state.problem);
    table.show(stopsAhead(state.problem, plan), ({ uav, stop, place, begin }) => {
      const committed = uav.committed?.includes(stop.target_id);
      const given = isReload(stop) ? ["reload_done", { uav_id: uav.id, base_id: stop.base_id, amounts: uav.loadlist.map((amount, k) => amount + stop.loaded[k]) }]
        : ["visit_done", { uav_id: uav.id, target_id: stop.target_id, amounts: stop.delivered }];
      return h("tr", { dataset: { uav: uav.id, stop: stop.target_id ?? stop.base_id, exact: String(given[1].amounts) } }, h("td", { class: "n" }, moment(state.problem, begin)), nameCell("uavs", uav),
        h("td", { class: "wide" }, nameOf(place), committed && h("span", { class: "chip" }, t("under way"))), h("td", { class: "n wide" }, isReload(stop) ? t("loads {amounts}", { amounts: amountsText(state.problem, stop.loaded) }) : amountsText(state.problem, stop.delivered)),
        h("td", {}, h("button", { type: "button", class: "quiet", "aria-label": t("{uav} at {place} is done", { uav: called(uav), place: nameOf(place) }), onclick: () => tellOf(...given) }, t("Done"))));
    });
  };
  return { title: t("Stops ahead"), open: true, table, draw };
}

/** Stops that are over, the newest first: as planned until they are reported. */
function done(tellOf) {
  const table = new LiveTable("stops done", t("Stops done"), [[t("At"), true], [t("UAV")], [t("Stops at")], [t("Amounts"), true], [""]]);
  const draw = ({ state }) => {
    const nameOf = placeNames(state.problem);
    const known = new Map(state.problem.uavs.map((uav) => [uav.id, uav]));
    table.show(state.done.toReversed(), (each) => {
      const at = each.target_id ? nameOf(each.target_id) : baseName(each.base_id);
      const uav = known.get(each.uav_id);
      const open = () => (each.target_id ? tellOf("visit_done", each) : tellOf("reload_done", { uav_id: each.uav_id, base_id: each.base_id }));
      return h("tr", { dataset: { uav: each.uav_id, stop: each.target_id ?? each.base_id, exact: String(each.amounts) } }, h("td", { class: "n" }, moment(state.problem, each.time)), nameCell("uavs", uav), h("td", { class: "wide" }, at), h("td", { class: "n wide" }, amountsText(state.problem, each.amounts)),
        h("td", {}, each.reported ? h("span", { class: "chip good" }, t("reported"))
          : h("button", { type: "button", class: "quiet", "aria-label": t("Report {uav} at {place}", { uav: called(uav), place: at }), onclick: open }, t("as planned"))));
    });
  };
  return { title: t("Stops done"), open: false, table, draw };
}

/** Areas: what each needs still, of what it asked for, and what the plan brings. */
function areas(chosen) {
  const table = new LiveTable("areas", t("Areas"), [[t("Area")], [t("Urgency"), true], [t("Still needed"), true], [t("Plan brings"), true]]);
  const draw = ({ state, plan }) => {
    const coming = brought(plan);
    const cancelled = new Set(state.cancelled);
    table.show(state.problem.targets, (target) =>
      h("tr", { class: cancelled.has(target.id) ? "lost" : null, dataset: { area: target.id } }, nameCell("targets", target, chosen), h("td", { class: "n" }, number(target.level)),
        h("td", { class: "n wide" }, target.requested ? tNodes("{amounts} of {asked}", { amounts: amountsCell(state.problem, target.loadlist), asked: h("span", { class: "hint" }, amountsText(state.problem, target.requested)) }).flat() : amountsCell(state.problem, target.loadlist)),
        h("td", { class: "n wide" }, cancelled.has(target.id) ? t("cancelled") : coming.has(target.id) ? amountsCell(state.problem, coming.get(target.id)) : "–")));
  };
  return { title: t("Areas"), open: false, table, draw };
}

/** Bases and what they have in stock. */
function bases(chosen) {
  const table = new LiveTable("bases", t("Bases"), [[t("Base")], [t("Stock"), true], [t("Turnaround"), true]]);
  const draw = ({ state: { problem } }) => table.show(problem[BASES] ?? [], (base) =>
    h("tr", { dataset: { base: base.id } }, nameCell(BASES, base, chosen), h("td", { class: "n wide" }, stockText(problem, base.stock)), h("td", { class: "n" }, durationText(problem, base.turnaround ?? 0))));
  return { title: t("Bases"), open: false, table, draw };
}

/**
 * All tables of a mission.
 * @param {(type: string, given: object) => void} tellOf opens a form of what has happened
 * @param {() => void} chosen is called when a name was chosen in a table far below what can be told of it
 * @returns {{element: HTMLElement, draw: (moment: {state: object, plan: object}, positions: object) => void}}
 */
export function missionTables(tellOf, chosen) {
  const all = [uavs(chosen), ahead(tellOf), done(tellOf), areas(chosen), bases(chosen)];
  const element = h("div", { class: "block" }, all.map(({ title, open, table }) => h("details", { class: "card", open }, h("summary", {}, title), table.element)));
  return { element, draw: (moment, positions) => all.forEach((each) => each.draw(moment, positions)) };
}
