/** What people call the fields of UAVs, areas, bases and zones, in tables, forms and lists that are imported. */

import { inLine, labelOf } from "./fields.js";
import { BASES, ZONES } from "./kinds.js";
import { t } from "./texts.js";

/** Fields that people call otherwise; all others go by their own names. */
const TITLES = {
  uavs: { id: t("UAV"), x_s: t("start x"), y_s: t("start y"), x_c: t("now x"), y_c: t("now y"), voyage: t("range"), dis: t("flown"), ret: t("returning"), loadlist: t("load") },
  targets: { id: t("Area"), level: t("urgency"), loadlist: t("need") },
  [BASES]: { id: t("Base") },
  [ZONES]: { id: t("Zone") },
};
/** Coordinates on the globe. */
const ON_GLOBE = { x: t("longitude"), y: t("latitude"), x_s: t("start longitude"), y_s: t("start latitude"), x_c: t("now longitude"), y_c: t("now latitude") };

/** What people call a field. @param {"uavs"|"targets"|"bases"|"no_fly_zones"} kind @param {boolean} globe whether positions are degrees */
export function fieldTitle(kind, name, globe) {
  return (globe && ON_GLOBE[name]) || TITLES[kind][name] || inLine(labelOf(name));
}

/** What people call the amount of a kind of material, from 0. @param {(string | undefined)[]} [names] of the materials, where they have some */
export function amountTitle(kind, name, k, globe, names) {
  const field = fieldTitle(kind, name, globe);
  return names?.[k] ? t("{field}: {material}", { field, material: names[k] }) : `${field} ${k + 1}`;
}

/** What people call a column of a table, which is a field or one of its amounts, `loadlist/0`. */
export function columnTitle(kind, column, globe, names) {
  const [field, k] = column.split("/");
  return k === undefined ? fieldTitle(kind, field, globe) : amountTitle(kind, field, Number(k), globe, names);
}
