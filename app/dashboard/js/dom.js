/** Elements, without markup in strings: what a client sent can never become part of the page's code. */

import { betweenAmounts, shown, t, tn } from "./texts.js";

/**
 * Make an element.
 * @param {string} tag
 * @param {object} [attributes] `on…` are listeners, `class`, `dataset` and properties as named; null and false are left out
 * @param {...any} children nodes, texts, or lists of them
 */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes ?? {})) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "dataset") Object.assign(element.dataset, value);
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

const SVG = "http://www.w3.org/2000/svg";

/** Make an SVG element. */
export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** A number for people, with the exact one in it: `<data value="…">`. */
export function number(value, digits = 4) {
  const exact = Number.isFinite(value) ? String(value) : null;
  return h("data", { value: exact, title: exact }, shown(value, digits));
}

const MANY_KINDS = 8;

/** Amounts in a line, exact ones in them; of many kinds those that are not zero, each with its kind's number. */
export function amounts(list) {
  if (list.length <= MANY_KINDS) return list.flatMap((amount, k) => [k ? betweenAmounts() : null, number(amount)]);
  const some = list.map((amount, k) => [amount, k]).filter(([amount]) => amount);
  if (!some.length) return [t("nothing")];
  const each = some.flatMap(([amount, k], n) => [n ? betweenAmounts() : null, number(amount), h("span", { class: "hint" }, " ", t("of kind {kind}", { kind: k + 1 }))]);
  return some.length <= MANY_KINDS ? each : [h("details", {}, h("summary", {}, tn(some.length, "{count} kind", "{count} kinds")), each)];
}

/** The same as a text, and no more than the first of many kinds. */
export function shortAmounts(list, between = betweenAmounts()) {
  if (list.length <= MANY_KINDS) return list.map((amount) => shown(amount)).join(between);
  const some = list.flatMap((amount, k) => (amount ? [`${shown(amount)} ${t("of kind {kind}", { kind: k + 1 })}`] : []));
  if (!some.length) return t("nothing");
  const first = some.slice(0, 3).join(between);
  return some.length > 3 ? tn(some.length - 3, "{first} and {count} more kind", "{first} and {count} more kinds", { first }) : first;
}

/** Take what was told of errors off the page: something new is tried. */
export function forgetErrors() {
  document.getElementById("alerts").replaceChildren();
}

/**
 * Tell something at the page's edge; it goes after a while, or when it is closed.
 * @param {string} text
 * @param {"info"|"error"} [tone]
 * @param {{title: string, act: () => void}} [offer] a button in it
 */
export function notify(text, tone = "info", offer = null) {
  const place = document.getElementById(tone === "error" ? "alerts" : "news");
  for (const same of [...place.children]) if (same.dataset.text === text) same.remove();
  const close = h("button", { type: "button", class: "quiet", "aria-label": t("Close this message"), onclick: () => notice.remove() }, "×");
  const notice = h("div", { class: `notice ${tone}`, dataset: { text } }, h("p", {}, text), offer && h("button", { type: "button", class: "quiet", onclick: () => { notice.remove(); offer.act(); } }, offer.title), close);
  place.append(notice);
  const end = () => (notice.matches(":hover, :focus-within") ? setTimeout(end, 2_000) : notice.remove());
  setTimeout(end, tone === "error" || offer ? 12_000 : 5_000);
}

/** Hand a text or blob to the user as a file. */
export function download(name, content, type) {
  const url = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  const link = h("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
