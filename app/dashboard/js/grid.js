/** An editable table that is used from the keyboard like a spreadsheet. */

import { h } from "./dom.js";
import { plainNumber, shown, t, writtenNumber } from "./texts.js";

/** With more rows than this only those near the ones in sight are there. */
const WINDOW = 240;
const MARGIN = 60;

/** A table of UAVs or areas, a row each. */
export class Grid {
  /**
   * @param {{label: string, kind: string, onEdit: (id: string, column: object, text: string) => void,
   *   onSelect: (id: string) => void, onDelete: (id: string) => void}} options
   */
  constructor(options) {
    this.options = options;
    this.rows = new Map();
    this.items = [];
    this.columns = [];
    this.head = h("tr", { role: "row" });
    this.body = h("tbody", { role: "rowgroup" });
    this.element = h("table", { role: "grid", "aria-label": options.label, class: "grid", dataset: { kind: options.kind } }, h("thead", { role: "rowgroup" }, this.head), this.body);
    this.from = 0;
    this.marked = { selected: null, faults: new Map() };
    document.addEventListener("scroll", ({ target }) => this.#onScroll(target), { capture: true, passive: true });
    this.body.addEventListener("click", (event) => this.#onClick(event));
    this.body.addEventListener("dblclick", (event) => this.#edit(event.target.closest("td")));
    this.body.addEventListener("keydown", (event) => this.#onKey(event));
  }

  /**
   * Show items; rows of items that did not change are kept.
   * @param {object[]} items
   * @param {{name: string, title: string, read: (item: object) => any, text?: boolean, flag?: boolean}[]} columns a flag is 1 or nothing, and is turned over instead of typed
   */
  show(items, columns) {
    const sameColumns = columns.map((c) => c.title).join() === this.columns.map((c) => c.title).join();
    if (!sameColumns) {
      this.rows.clear();
      this.head.replaceChildren(...columns.map((column) => h("th", { role: "columnheader", scope: "col", class: column.name === "id" || column.text ? null : "num" }, column.title)), h("th", { role: "columnheader" }, h("span", { class: "visually-hidden" }, t("Delete"))));
    }
    this.columns = columns;
    const active = document.activeElement?.closest?.("table") === this.element ? document.activeElement.closest("td") : null;
    const had = active && this.#place(active);
    this.items = items;
    this.element.setAttribute("aria-rowcount", String(items.length + 1));
    this.#fill(this.from);
    if (had) this.focus(Math.min(had.row, items.length - 1), had.column);
  }

  /** Make the rows from one on, and keep the room of all others. */
  #fill(from) {
    const all = this.items.length <= WINDOW;
    this.from = all ? 0 : Math.max(0, Math.min(from, this.items.length - WINDOW));
    const shown = all ? this.items : this.items.slice(this.from, this.from + WINDOW);
    const kept = new Map();
    for (const [at, item] of shown.entries()) {
      const known = this.rows.get(item.id);
      const row = known?.item === item ? known : { item, element: this.#row(item) };
      row.element.setAttribute("aria-rowindex", String(this.from + at + 2));
      kept.set(item.id, row);
    }
    this.rows = kept;
    const room = (count) => {
      if (!count) return [];
      const made = h("tr", { class: "room", role: "presentation" }, h("td", { role: "presentation", colspan: String(this.columns.length + 1) }));
      made.firstChild.style.height = `${count * this.#height()}px`;
      return [made];
    };
    this.body.replaceChildren(...room(this.from), ...[...kept.values()].map(({ element }) => element), ...room(this.items.length - this.from - shown.length));
    this.#mark();
    const first = this.body.querySelector("td[data-column]");
    if (first && !this.body.querySelector('td[tabindex="0"]')) first.tabIndex = 0;
  }

  /** Of a row, in pixels. */
  #height() {
    for (const { element } of this.rows.values()) if (element.offsetHeight) this.height = element.getBoundingClientRect().height;
    return this.height ?? 28;
  }

  #onScroll(scroller) {
    if (this.items.length <= WINDOW || this.element.hidden || !scroller.contains?.(this.element)) return;
    const height = this.#height();
    const top = Math.floor((scroller.getBoundingClientRect().top - this.body.getBoundingClientRect().top) / height);
    const end = top + Math.ceil(scroller.clientHeight / height);
    const missing = (top < this.from && this.from > 0) || (end > this.from + WINDOW && this.from + WINDOW < this.items.length);
    if (missing && !this.body.contains(document.activeElement?.closest("input"))) this.#fill(top - MARGIN);
  }

  /** The row of an item, made where it was not there. */
  #rowAt(at) {
    if (at < 0 || at >= this.items.length) return null;
    if (at < this.from || at >= this.from + WINDOW) this.#fill(at - WINDOW / 2);
    return this.rows.get(this.items[at].id)?.element ?? null;
  }

  /** Mark the selected row and the cells that the service refuses. @param {Map<string, string>} faults by `row/column` */
  mark(selected, faults = new Map()) {
    this.marked = { selected, faults };
    this.#mark();
  }

  #mark() {
    const { selected, faults } = this.marked;
    for (const [id, { element }] of this.rows) element.setAttribute("aria-selected", String(id === selected));
    for (const cell of this.body.querySelectorAll("[aria-invalid]")) {
      cell.removeAttribute("aria-invalid");
      cell.removeAttribute("title");
    }
    for (const [key, detail] of faults) {
      const cut = key.indexOf("/");
      const [row, name] = [key.slice(0, cut), key.slice(cut + 1)];
      const cells = this.rows.get(this.items[Number(row)]?.id)?.element;
      // What is wrong with a word of a list is shown at the list.
      const cell = [name, name.split("/")[0]].map((each) => cells?.querySelector(`td[data-column="${CSS.escape(each)}"]`)).find(Boolean);
      cell?.setAttribute("aria-invalid", "true");
      if (cell) cell.title = detail;
    }
  }

  /** Go to a cell. */
  focus(row, column) {
    const cell = this.#rowAt(row)?.cells[column];
    if (!cell) return;
    for (const other of this.body.querySelectorAll('td[tabindex="0"]')) other.tabIndex = -1;
    cell.tabIndex = 0;
    cell.focus();
    cell.scrollIntoView({ block: "nearest", inline: "nearest" });
  }

  /** Bring a row into sight. */
  reveal(id) {
    this.#rowAt(this.items.findIndex((item) => item.id === id))?.scrollIntoView({ block: "nearest" });
  }

  #row(item) {
    const cells = this.columns.map((column) => {
      const value = column.read(item);
      return h("td", { role: "gridcell", tabindex: "-1", class: column.name === "id" || column.text ? null : "num", dataset: { column: column.name } }, column.flag ? (value ? "✓" : "") : value === undefined ? "" : typeof value === "number" ? shown(value, 8) : String(value));
    });
    const says = t("Delete {item}", { item: item.id });
    const remove = h("button", { type: "button", class: "quiet", tabindex: "-1", "aria-label": says, title: says }, "×");
    return h("tr", { role: "row", dataset: { id: item.id } }, cells, h("td", { role: "gridcell", tabindex: "-1" }, remove));
  }

  #place(cell) {
    return { row: Number(cell.parentElement.getAttribute("aria-rowindex")) - 2, column: cell.cellIndex };
  }

  #onClick(event) {
    const row = event.target.closest("tr");
    if (!row?.dataset.id) return;
    if (event.target.closest("button")) this.options.onDelete(row.dataset.id);
    else this.options.onSelect(row.dataset.id);
  }

  #onKey(event) {
    const cell = event.target.closest("td");
    if (event.target.tagName === "INPUT") return;
    const { row, column } = this.#place(cell);
    const step = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
    if (step) {
      event.preventDefault();
      this.focus(row + step[0], column + step[1]);
      this.options.onSelect(document.activeElement.closest("tr")?.dataset.id);
    } else if (event.key === "Enter" || event.key === "F2") {
      event.preventDefault();
      if (cell.dataset.column) this.#edit(cell);
      else this.options.onDelete(cell.parentElement.dataset.id);
    } else if (event.key === "Delete") {
      this.options.onDelete(cell.parentElement.dataset.id);
    } else if (event.key.length === 1 && !event.ctrlKey && !event.metaKey && !event.altKey && cell.dataset.column) {
      event.preventDefault();
      this.#edit(cell, event.key);
    }
  }

  #edit(cell, typed = null) {
    const column = this.columns.find((each) => each.name === cell?.dataset.column);
    if (!column || cell.querySelector("input")) return;
    const { id } = cell.parentElement.dataset;
    const value = column.read(this.rows.get(id).item);
    if (column.flag) return this.options.onEdit(id, column, value ? "" : "1");
    const before = value === undefined ? "" : typeof value === "number" ? writtenNumber(value) : String(value);
    const was = [...cell.childNodes];
    const { row, column: at } = this.#place(cell);
    const input = h("input", { "aria-label": t("{field} of {item}", { field: column.title, item: id }), value: typed ?? before, spellcheck: "false" });
    let ended = false;
    const end = (keep, back) => {
      if (ended) return;
      ended = true;
      cell.replaceChildren(...was);
      if (back) this.focus(row, at);
      const text = input.value.trim();
      if (keep && text !== before) this.options.onEdit(id, column, column.text ? text : plainNumber(text));
    };
    input.addEventListener("keydown", (event) => {
      if (event.key === "Enter" || event.key === "Escape") {
        event.preventDefault();
        event.stopPropagation();
        end(event.key === "Enter", true);
      }
    });
    input.addEventListener("blur", () => end(true, false));
    cell.replaceChildren(input);
    input.focus();
    if (typed === null) input.select();
  }
}
