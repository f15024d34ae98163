/** A table whose rows follow what is known: a row that has not changed stays as it is, with what has the focus in it. */

import { h } from "../dom.js";
import { Portions } from "../portions.js";
import { t } from "../texts.js";

/** A table in a box that scrolls. */
export class LiveTable {
  /** @param {string} name for the page's code @param {string} label @param {[string, boolean?][]} titles of the columns, and whether they have numbers */
  constructor(name, label, titles) {
    this.titles = titles.map(([title]) => title);
    this.body = h("tbody", {});
    this.count = 0;
    const head = ([title, numeric]) => h(title ? "th" : "td", { scope: title ? "col" : null, class: numeric ? "n" : null }, title);
    this.element = h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": label },
      h("table", { "data-testid": `mission-${name}` }, h("thead", {}, h("tr", {}, titles.map(head))), this.body));
  }

  /** Show rows in place of those before. @param {any[]} items @param {(item: any) => HTMLTableRowElement} row each told apart by its data */
  show(items, row) {
    const fresh = h("tbody", {});
    const portions = new Portions(fresh, items, (item) => titled(row(item), this.titles), (button) => h("tr", {}, h("td", { colspan: String(this.titles.length) }, button)));
    portions.upTo(Math.min(this.portions?.count ?? 0, items.length));
    if (!items.length) fresh.append(h("tr", {}, h("td", { colspan: String(this.titles.length), class: "hint" }, t("None."))));
    const [before, after] = [[...this.body.rows], [...fresh.rows]];
    const focus = this.#focus();
    if (before.length === after.length && before.every((old, at) => keyOf(old) === keyOf(after[at]))) {
      before.forEach((old, at) => { if (!alike(old, after[at])) old.replaceWith(after[at]); });
    } else this.body.replaceChildren(...after);
    this.portions = portions;
    portions.place = this.body;
    portions.first = this.body.rows[0];
    if (focus && !this.body.contains(document.activeElement)) this.#restore(focus);
  }

  #focus() {
    const row = this.body.contains(document.activeElement) ? document.activeElement.closest("tr") : null;
    return row && { key: keyOf(row), at: [...row.querySelectorAll("button")].indexOf(document.activeElement) };
  }

  #restore({ key, at }) {
    const row = [...this.body.rows].find((each) => keyOf(each) === key);
    (row?.querySelectorAll("button")[at] ?? this.element).focus({ preventScroll: true });
  }
}

/** A row whose cells know their titles: where there is no room for columns, `mission.css` has a line for each, its title first. */
export function titled(row, titles) {
  [...row.cells].forEach((cell, at) => { cell.dataset.title = titles[at]; });
  return row;
}

function keyOf({ dataset: { exact: _, ...names } }) {
  return JSON.stringify(names);
}

/** Whether a row shows the same; what is selected is marked afterwards. */
function alike(old, fresh) {
  const copy = old.cloneNode(true);
  copy.classList.remove("chosen");
  if (!copy.classList.length) copy.removeAttribute("class");
  return copy.isEqualNode(fresh);
}
