/** What people call the fields of UAVs, areas, bases and zones, in tables, forms and lists that are imported. */

import { BASES, ZONES } from "./kinds.js";

/** Fields that people call otherwise; all others go by their own names. */
const TITLES = {
  uavs: { id: "UAV", x_s: "start x", y_s: "start y", x_c: "now x", y_c: "now y", voyage: "range", dis: "flown", ret: "returning", loadlist: "load" },
  targets: { id: "Area", level: "urgency", loadlist: "need" },
  [BASES]: { id: "Base" },
  [ZONES]: { id: "Zone" },
};
/** Coordinates on the globe. */
const ON_GLOBE = { x: "longitude", y: "latitude", "start x": "start longitude", "start y": "start latitude", "now x": "now longitude", "now y": "now latitude" };

/** What people call a field. @param {"uavs"|"targets"|"bases"|"no_fly_zones"} kind @param {boolean} globe whether positions are degrees */
export function fieldTitle(kind, name, globe) {
  const title = TITLES[kind][name] ?? name.replaceAll("_", " ");
  return (globe && ON_GLOBE[title]) || title;
}

/** What people call the amount of a kind of material, from 0. */
export function amountTitle(kind, name, k, globe) {
  return `${fieldTitle(kind, name, globe)} ${k + 1}`;
}
