/** What a new plan in the middle of a mission changes against the rest of the old one. */

import { h, number, shown } from "./dom.js";
import { names, placeNames } from "./plan.js";

/**
 * @param {object} difference as `changes` of `mid_mission.js` has it
 * @param {object} problem of the new plan
 * @param {object} answer the new plan
 */
export function differenceOf(difference, problem, answer) {
  const [uavOf, areaOf] = [names(problem.uavs), placeNames(problem)];
  const list = (ids) => (ids.length ? ids.map(areaOf).join(" → ") : "home");
  const percent = (share) => (share === null ? "–" : `${Math.round(100 * share)} %`);
  const gained = difference.kept && answer.reward - difference.kept.reward;
  const moved = difference.areas.filter(({ before, after }) => Math.abs((before ?? 0) - (after ?? 0)) > 1e-6);
  return (
    h("section", { class: "difference", "data-testid": "field-changes" },
      h("h3", {}, "What the new plan changes"),
      difference.kept
        ? h("p", {}, "Going on with the old plan would earn ", number(difference.kept.reward), ", the new one earns ",
          number(answer.reward), " (", h("strong", {}, `${gained >= 0 ? "+" : ""}${shown(gained)}`), ").")
        : h("p", {}, "Nothing of the old plan can be flown any more; the new one earns ", number(answer.reward), "."),
      h("div", { class: "two" },
        h("table", {},
          h("thead", {}, h("tr", {}, ["UAV", "Before", "Now", ""].map((title) => h("th", { scope: "col" }, title)))),
          h("tbody", {}, difference.routes.filter((route) => route.kind === "lost" || route.before.length || route.after.length).map((route) =>
            h("tr", { "data-uav": route.uav_id, class: route.kind },
              h("th", { scope: "row", title: route.uav_id }, uavOf(route.uav_id)), h("td", {}, list(route.before)),
              h("td", {}, route.kind === "lost" ? "–" : list(route.after)), h("td", {}, h("span", { class: "chip" }, route.kind)))))),
        h("table", {},
          h("thead", {}, h("tr", {}, ["Area", "Met before", "Met now"].map((title, i) => h("th", { scope: "col", class: i ? "n" : null }, title)))),
          h("tbody", {}, moved.length
            ? moved.map((area) => h("tr", { "data-area": area.target_id },
              h("th", { scope: "row", title: area.target_id }, areaOf(area.target_id)), h("td", { class: "n" }, percent(area.before)), h("td", { class: "n" }, percent(area.after))))
            : h("tr", {}, h("td", { colspan: "3" }, "Every area gets what it would have got.")))))));
}
