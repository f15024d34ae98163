/** Elements, without markup in strings: what a client sent can never become part of the page's code. */

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
  return h("data", { value: String(value), title: String(value) }, shown(value, digits));
}

/** A number in at most so many significant digits, whole numbers in full. */
export function shown(value, digits = 4) {
  if (value === null || value === undefined) return "–";
  if (Number.isInteger(value)) return String(value);
  const text = Number(value.toPrecision(Math.max(digits, Math.floor(Math.log10(Math.abs(value))) + 1)));
  return String(text).replace("-", "−");
}

/** Tell something at the page's edge; it goes after a while. @param {"info"|"error"} tone */
export function notify(text, tone = "info") {
  const notice = h("p", { class: `notice ${tone}`, role: tone === "error" ? "alert" : null }, text);
  document.getElementById("notices").append(notice);
  setTimeout(() => notice.remove(), tone === "error" ? 10_000 : 4_000);
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
