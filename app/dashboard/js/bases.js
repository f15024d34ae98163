/** Bases and what they have in stock, before and after a plan. */

import { amounts, h, shortAmounts } from "./dom.js";
import { called } from "./plan.js";

const UNLIMITED = "as much as is asked for";

/** A stock in words. @param {number[] | null | undefined} stock */
export function stockText(stock) {
  return stock ? shortAmounts(stock) : UNLIMITED;
}

/** What the bases of a problem have left after a plan; null where it has none. */
export function stocksLeft(problem, answer) {
  if (!answer.bases?.length) return null;
  const known = new Map((problem.bases ?? []).map((base) => [base.id, base]));
  const cell = (stock) => h("td", { class: "num" }, stock ? amounts(stock) : UNLIMITED);
  return h("details", { open: true }, h("summary", {}, `Stocks of ${answer.bases.length} ${answer.bases.length === 1 ? "base" : "bases"}`),
    h("table", { id: "stocks" }, h("thead", {}, h("tr", {}, ["Base", "Before", "Left"].map((title, at) => h("th", { scope: "col", class: at ? "num" : null }, title)))),
      h("tbody", {}, answer.bases.map(({ base_id: id, stock }) => h("tr", { dataset: { baseId: id } },
        h("th", { scope: "row", title: id }, called(known.get(id) ?? { id })), cell(known.get(id)?.stock), cell(stock))))));
}
