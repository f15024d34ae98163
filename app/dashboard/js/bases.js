/** Bases and what they have in stock, before and after a plan. */

import { h } from "./dom.js";
import { amountsCell, amountsHead, amountsText } from "./materials.js";
import { called } from "./plan.js";
import { t, tn } from "./texts.js";

const UNLIMITED = t("as much as is asked for");

/** A stock in words. @param {object} problem @param {number[] | null | undefined} stock */
export function stockText(problem, stock) {
  return stock ? amountsText(problem, stock) : UNLIMITED;
}

/** What the bases of a problem have left after a plan; null where it has none. */
export function stocksLeft(problem, answer) {
  if (!answer.bases?.length) return null;
  const known = new Map((problem.bases ?? []).map((base) => [base.id, base]));
  const cell = (stock) => h("td", { class: "num" }, stock ? amountsCell(problem, stock) : UNLIMITED);
  return h("details", { open: true }, h("summary", {}, tn(answer.bases.length, "Stock of {count} base", "Stocks of {count} bases")),
    h("table", { id: "stocks" }, h("thead", {}, h("tr", {}, [t("Base"), amountsHead(problem, t("Before")), amountsHead(problem, t("Left"))].map((title, at) => h("th", { scope: "col", class: at ? "num" : null }, title)))),
      h("tbody", {}, answer.bases.map(({ base_id: id, stock }) => h("tr", { dataset: { baseId: id } },
        h("th", { scope: "row", title: id }, called(known.get(id) ?? { id })), cell(known.get(id)?.stock), cell(stock))))));
}
