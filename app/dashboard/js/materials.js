/** Kinds of material and amounts of them, by the names that the problem gives them. */

import { amounts, h, number, shortAmounts } from "./dom.js";
import { materials } from "./problem.js";
import { betweenAmounts, shown, t, tn, tNodes } from "./texts.js";

const MOST_NAMED = 8;

/** Names of the kinds of material; null where the problem names none. @returns {string[] | null} */
export function materialNames(problem) {
  if (!problem.materials?.length) return null;
  return problem.materials.map(({ name }, k) => name ?? materialName(problem, k));
}

/** The name of a kind of material, from 0. */
export function materialName(problem, k) {
  return problem.materials?.[k]?.name ?? t("material {number}", { number: k + 1 });
}

/** One amount with the name of its kind; units where the one kind that there is has no name. */
export function amountText(problem, amount, k) {
  if (materials(problem) === 1 && !materialNames(problem)) return tn(amount, "{count} unit", "{count} units");
  return t("{amount} {material}", { amount: shown(amount), material: materialName(problem, k) });
}

/** Amounts as a text, those that are not zero, each with its kind. */
export function amountsText(problem, list, most = MOST_NAMED) {
  const some = list.flatMap((amount, k) => (amount ? [amountText(problem, amount, k)] : []));
  if (!some.length) return t("nothing");
  if (some.length <= most) return some.join(betweenAmounts());
  return tn(some.length - most, "{first} and {count} more kind", "{first} and {count} more kinds", { first: some.slice(0, most).join(betweenAmounts()) });
}

/** Amounts in a cell of a table: a line a kind that has a name, numbers alone otherwise, as the head of the column says. */
export function amountsCell(problem, list) {
  const names = materialNames(problem);
  if (!names || list.length > MOST_NAMED) return amounts(list);
  const some = list.flatMap((amount, k) => (amount ? [h("span", { class: "amount" }, tNodes("{amount} {material}", { amount: number(amount), material: names[k] }))] : []));
  return some.length ? some : [t("nothing")];
}

/** What stands above such a column, where the cells do not say it themselves. */
export function amountsHead(problem, title) {
  if (materialNames(problem)) return title;
  return materials(problem) === 1 ? t("{column}, units", { column: title }) : t("{column}, by material", { column: title });
}

/** Amounts as numbers alone, where there is no place for names. */
export function numbersText(list, between = betweenAmounts()) {
  return shortAmounts(list, between);
}
