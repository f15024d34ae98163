/** The dialog in which the columns of a list become fields of UAVs, areas or bases. */

import { h } from "./dom.js";
import { labelled } from "./fields.js";
import { toCells } from "./formats/cells.js";
import { choices, degreesLikely, guess, itemsOf, kindOf, leftOut, materialsOf, missingOf, rightRow } from "./formats/places.js";
import { BASES } from "./kinds.js";
import { materials, newItem } from "./problem.js";
import { isAmounts, itemFields } from "./schema.js";
import { get } from "./state.js";
import { listed, plainNumber, t, tn, writtenNumber } from "./texts.js";

const SHOWN_ROWS = 5;
const SHOWN_FAULTS = 5;
/** Kinds of material that there are to choose from at least, where a list has as many columns. */
const LEAST_AMOUNTS = 12;
const KINDS = { targets: t("Areas"), uavs: t("UAVs"), [BASES]: t("Bases") };
const POSITIONS = { wgs84: t("longitude and latitude, in degrees"), local: t("x and y, on a plane") };
const WAYS = {
  add: () => t("Add them to what is there"),
  replace: (kind) => ({ targets: t("Put them in the place of the areas that are there"), uavs: t("Put them in the place of the UAVs that are there"), [BASES]: t("Put them in the place of the bases that are there") })[kind],
  new: () => t("Begin a new problem with them"),
};
const FOUND = {
  targets: (areas, rows) => t("{areas} areas of {rows} rows can be read.", { areas, rows }),
  uavs: (uavs, rows) => t("{uavs} UAVs of {rows} rows can be read.", { uavs, rows }),
  [BASES]: (bases, rows) => t("{bases} bases of {rows} rows can be read.", { bases, rows }),
};
/** What is said where no column is an amount: one for all stands below. */
const NO_AMOUNTS = {
  targets: () => t("No column says what the areas need: each gets the need below. Choose a column above where there is one."),
  uavs: () => t("No column says what the UAVs carry: each gets the load below. Choose a column above where there is one."),
};
/** Columns by names that the import knows in this language too. */
const TEMPLATES = {
  targets: [[t("name"), t("latitude"), t("longitude"), t("need"), t("urgency"), t("deadline")], ["Dondo", -19.61, 34.74, 20, 2, ""], ["Buzi", -19.88, 34.6, 12, 1, 3]],
  uavs: [[t("name"), t("latitude"), t("longitude"), t("speed"), t("range"), t("load")], ["Wing 1", -19.8, 34.9, 100, 150, 2], ["Copter 1", -19.8, 34.9, 50, 15, 5]],
  [BASES]: [[t("name"), t("latitude"), t("longitude"), t("stock")], ["Port", -19.83, 34.84, 500]],
};

/** A table with the columns that a list may have, and rows to be written over. @param {"uavs"|"targets"|"bases"} kind */
export function templateOf(kind) {
  return toCells(TEMPLATES[kind]);
}

/**
 * Ask what the columns of a list are, and what is to be done with it.
 * @param {import("./formats/places.js").Sheet} sheet
 * @param {string} name where it is from
 * @returns {Promise<{kind: string, items: object[], how: "add"|"replace"|"new", crs: string, materials: (string | undefined)[]} | null>}
 *   `materials` are names by kind; null where nothing is to be done
 */
export function askForColumns(sheet, name) {
  return new Promise((resolve) => {
    const dialog = new ImportDialog(sheet, name, resolve);
    document.body.append(dialog.element);
    dialog.element.showModal();
  });
}

class ImportDialog {
  constructor(sheet, name, resolve) {
    Object.assign(this, { sheet, resolve, kind: kindOf(sheet) });
    const { problem, past } = get();
    const first = guess(sheet, this.#known(this.kind, this.#most(), true));
    const globe = degreesLikely(sheet, first);
    // An example that nobody has changed is not what a list is added to.
    const fits = globe || problem.crs !== "wgs84";
    const choice = (entries, chosen, onchange, attributes = {}) => h("select", { ...attributes, onchange }, entries.map(([value, text]) => h("option", { value, selected: value === chosen }, text)));
    this.kinds = choice(Object.entries(KINDS), this.kind, () => this.#begin(), { name: "kind" });
    this.positions = choice(Object.entries(POSITIONS), globe ? "wgs84" : "local", () => this.#redraw(), { name: "positions" });
    this.positions.disabled = sheet.globe;
    this.ways = choice([], "", () => this.#redraw(), { name: "how" });
    this.way = past.length && fits ? "add" : "new";
    this.table = h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": t("The first rows") });
    this.left = h("p", { class: "warning", hidden: true, dataset: { says: "left-out" } });
    this.amountless = h("p", { class: "warning", hidden: true, dataset: { says: "no-amounts" } });
    this.others = h("div", { class: "grid2" });
    this.found = h("p", { role: "status" });
    this.faults = h("div", { role: "alert" });
    this.lax = h("input", { type: "checkbox", onchange: () => this.#judge() });
    this.laxly = h("label", { class: "row", hidden: true }, this.lax, t("Leave out the rows that cannot be read"));
    this.take = h("button", { class: "primary", value: "take" }, t("Import"));
    const form = h("form", { method: "dialog" }, h("h2", { id: "import-heading" }, t("Import {file}", { file: name })),
      sheet.notices.map((notice) => h("p", { class: "hint" }, `${notice}.`)),
      h("div", { class: "grid2" }, labelled(t("These are"), this.kinds), labelled(t("Positions"), this.positions)),
      h("p", { class: "hint" }, t("Above each column: what it is. Columns that are left out are not read.")),
      this.table, this.left, this.amountless, this.others, labelled(t("What to do with them"), this.ways), this.found, this.faults, this.laxly,
      h("p", { class: "actions" }, h("button", { type: "button", class: "quiet", onclick: () => this.element.close() }, t("Cancel")), this.take));
    this.element = h("dialog", { id: "import-dialog", "aria-labelledby": "import-heading" }, form);
    this.element.addEventListener("close", () => this.#end());
    this.#begin();
  }

  #known(kind, count, globe, names) {
    return choices(get().fields, kind, count, globe, names);
  }

  /** As many kinds of material as the list could have beside those that there are, within what a problem may have. */
  #most() {
    const { fields, problem } = get();
    const limits = Object.values(itemFields(fields, this.kind)).filter(isAmounts).map(({ maxItems }) => maxItems);
    return Math.min(...limits, Math.max(LEAST_AMOUNTS, materials(problem) + this.sheet.columns.length));
  }

  /** Names that materials have before the list comes. */
  #named(how) {
    return how === "new" ? [] : (get().problem.materials ?? []).map(({ name }) => name);
  }


  /** Begin anew with another kind of items. */
  #begin() {
    this.kind = this.kinds.value;
    this.guessedFor = null;
    this.byHand = false;
    this.typed = {};
    this.#redraw();
  }

  #redraw() {
    const { problem } = get();
    const globe = this.positions.value === "wgs84";
    // What is on a plane and what is on the globe cannot be one problem.
    const alone = (problem.crs === "wgs84") !== globe;
    const chosen = alone ? "new" : this.ways.value || this.way;
    this.ways.replaceChildren(...Object.entries(WAYS).filter(([how]) => how === "new" || !alone).map(([how, text]) => h("option", { value: how, selected: how === chosen }, text(this.kind))));
    // Its materials are those of the problem that it comes to, or its own.
    if (!this.byHand && chosen !== this.guessedFor) {
      this.assigned = guess(this.sheet, this.#known(this.kind, this.#most(), true), this.#named(chosen));
      this.guessedFor = chosen;
    }
    const beside = chosen === "new" ? {} : problem;
    const named = 1 + Math.max(0, ...this.assigned.map((name) => Number(name?.split("/")[1] ?? 0)));
    const there = beside.uavs ? materials(problem) : 1;
    const count = Math.min(this.#most(), Math.max(named + 1, there));
    this.materials = materialsOf(this.sheet, this.assigned, this.#named(chosen));
    this.known = this.#known(this.kind, Math.max(named, Math.min(count, Math.max(there, this.sheet.columns.length))), globe, this.materials);
    this.#drawTable();
    this.#drawOthers(newItem(this.kind, { crs: this.positions.value, uavs: [], targets: [], ...beside }));
    this.#judge();
  }

  #drawTable() {
    const { columns, rows } = this.sheet;
    const pick = (column, at) => {
      const select = h("select", { dataset: { column: String(at) }, "aria-label": column ? t("What the column {column} is", { column }) : t("What column {number} is", { number: at + 1 }), onchange: () => this.#assign(at, select.value || null) },
        h("option", { value: "" }, t("left out")), this.known.map(({ name, title }) => h("option", { value: name, selected: name === this.assigned[at] }, title)));
      return select;
    };
    this.table.replaceChildren(h("table", {},
      h("thead", {}, h("tr", {}, columns.map((column, at) => h("th", { scope: "col" }, pick(column, at), column)))),
      h("tbody", {}, rows.slice(0, SHOWN_ROWS).map(({ cells }) => h("tr", {}, columns.map((_, at) => h("td", {}, cells[at] ?? "")))))));
  }

  /** A column becomes a field, which no other column is any more. */
  #assign(at, name) {
    this.assigned = this.assigned.map((each, other) => (other === at ? name : each === name ? null : each));
    this.byHand = true;
    this.#redraw();
    this.table.querySelector(`[data-column="${at}"]`).focus();
  }

  /** Fields that are needed and that no column is: one value for all. */
  #drawOthers(like) {
    const valueOf = (name) => {
      const [field, k] = name.split("/");
      if (name in this.typed) return this.typed[name];
      return k === undefined ? like[field] : (like[field]?.[Number(k)] ?? 0);
    };
    const free = missingOf(this.known, this.assigned).filter(({ name }) => valueOf(name) !== undefined);
    const left = leftOut(this.sheet, this.assigned);
    this.left.hidden = !left.length;
    this.left.textContent = left.length ? tn(left.length, "{count} column is left out: {columns}", "{count} columns are left out: {columns}", { columns: listed(left) }) : "";
    const amountless = free.some(({ name }) => name.includes("/"));
    this.amountless.hidden = !amountless;
    this.amountless.textContent = amountless ? NO_AMOUNTS[this.kind]() : "";
    this.others.replaceChildren(...free.map(({ name, title }) => {
      const input = h("input", { name, value: writtenNumber(valueOf(name)), inputmode: "decimal", autocomplete: "off", oninput: () => { this.typed[name] = input.value; this.#judge(); } });
      return labelled(t("{field}, of all", { field: title }), input);
    }));
  }

  #judge() {
    const otherwise = {};
    for (const { name, value } of this.others.querySelectorAll("input")) {
      const number = plainNumber(value.trim());
      if (number && Number.isFinite(Number(number))) otherwise[name] = Number(number);
    }
    const { items, faults } = itemsOf(this.sheet, this.assigned, this.known, otherwise);
    this.items = items;
    this.found.textContent = FOUND[this.kind](items.length, this.sheet.rows.length);
    const more = faults.length - SHOWN_FAULTS;
    this.faults.replaceChildren(...(faults.length ? [h("ul", { class: "violations" }, faults.slice(0, SHOWN_FAULTS).map((fault) => h("li", { class: "error" }, fault)), more > 0 && h("li", { class: "error" }, t("and {count} more", { count: more }))), h("p", { class: "hint" }, t("A row of these columns is right like this: {row}", { row: rightRow(this.sheet, this.assigned) }))] : []));
    this.laxly.hidden = !faults.length || !items.length;
    this.take.disabled = !items.length || (faults.length > 0 && !this.lax.checked);
  }

  #end() {
    const { returnValue } = this.element;
    this.element.remove();
    this.resolve(returnValue === "take" ? { kind: this.kind, items: this.items, how: this.ways.value, crs: this.positions.value, materials: this.materials } : null);
  }
}
