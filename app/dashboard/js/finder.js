/** A long answer narrowed down: what has a name that is looked for, and the latest or most lacking first. */

import { h } from "./dom.js";
import { called, placeNames, sum } from "./plan.js";
import { requestedBy } from "./problem.js";
import { placeOf } from "./stops.js";
import { t } from "./texts.js";
import { allTimes } from "./times.js";

/** With fewer UAVs and areas than this all is seen at once. */
const LONG = 30;
const REST_MS = 120;

/** Fields to look for names with, and for an order. */
export class Finder {
  /** @param {() => void} changed is told when another choice is wanted */
  constructor(changed) {
    let later = null;
    const soon = () => { clearTimeout(later); later = setTimeout(changed, REST_MS); };
    this.text = h("input", { type: "search", name: "find", autocomplete: "off", oninput: soon });
    this.order = h("select", { name: "order", onchange: changed }, h("option", { value: "" }, t("as in the problem")), h("option", { value: "late" }, t("latest and most lacking first")));
    this.element = h("div", { class: "grid2", id: "finder" }, h("label", {}, t("Find a UAV or an area"), this.text), h("label", {}, t("Order"), this.order));
  }

  /** Show the fields where a problem is long. */
  fit(problem) {
    this.element.hidden = problem.uavs.length + problem.targets.length < LONG;
    if (this.element.hidden) this.text.value = this.order.value = "";
  }

  /**
   * The routes and unmet needs that are wanted, in the order that is wanted.
   * @param {object} problem
   * @param {object} plan an answer, or an evaluation
   * @returns {{routes: object[], unmet: object[]}} routes without stops are left out
   */
  choose(problem, plan) {
    const wanted = this.text.value.trim().toLowerCase();
    const has = (...names) => !wanted || names.some((name) => name.toLowerCase().includes(wanted));
    const uavs = new Map(problem.uavs.map((uav) => [uav.id, uav]));
    const areas = new Map(problem.targets.map((area) => [area.id, area]));
    const nameOf = placeNames(problem);
    let routes = plan.routes.filter(({ uav_id: id, stops }) => stops.length && has(id, called(uavs.get(id)), ...stops.map((stop) => nameOf(placeOf(stop)))));
    let unmet = plan.unmet.filter(({ target_id: id }) => has(id, called(areas.get(id))));
    if (this.order.value === "late") {
      const home = new Map(allTimes(problem, plan).map((times, i) => [problem.uavs[i].id, times.home]));
      const lacks = ({ target_id: id, remaining }) => areas.get(id).level * (sum(remaining) / (sum(requestedBy(areas.get(id))) || 1));
      routes = routes.toSorted((a, b) => home.get(b.uav_id) - home.get(a.uav_id));
      unmet = unmet.toSorted((a, b) => lacks(b) - lacks(a));
    }
    return { routes, unmet };
  }
}
