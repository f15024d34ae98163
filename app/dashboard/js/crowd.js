/** The UAVs that wait at one place, as a list to choose from. */

import { paint } from "./colours.js";
import { h } from "./dom.js";
import { called } from "./plan.js";
import { Portions } from "./portions.js";
import { tn } from "./texts.js";

/** @param {object[]} uavs @param {(uav: object) => void} chosen */
export function crowdList(uavs, chosen) {
  const list = h("ul", { class: "crowd-list" });
  const item = (uav) => h("li", {}, h("button", { type: "button", class: "quiet", dataset: { uavId: uav.id }, onclick: () => chosen(uav) }, paint(h("span", { class: "key", "aria-hidden": "true" }), uav.id), called(uav)));
  new Portions(list, uavs, item, (button) => h("li", {}, button));
  return h("div", {}, h("p", { class: "hint" }, tn(uavs.length, "{count} UAV waits here", "{count} UAVs wait here")), list);
}
