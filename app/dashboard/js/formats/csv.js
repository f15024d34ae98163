/** A problem as CSV: a row an item, one of `kind` problem for the settings. Columns are the service's fields. */

import { POINTS } from "../kinds.js";
import { amountsOf, heldSettings, isAmounts, isWords, itemFields } from "../schema.js";
import { t } from "../texts.js";
import { wordsIn, writtenWords } from "../words.js";
import { Numbers, plainText, rowText, table, toCells } from "./cells.js";
import { FormatError } from "./error.js";

const TRUTHS = { true: true, yes: true, 1: true, false: false, no: false, 0: false };

/** What columns of amounts are named, before their number. */
function stem(name) {
  return name === "loadlist" ? "load" : name;
}

/** Settings with their way in the problem; those of an object that is always there stand by themselves. Lists of items are rows. */
function settingsOf(fields) {
  const rows = new Set(Object.values(POINTS));
  return Object.entries(fields.settings).filter(([name]) => !rows.has(name)).flatMap(([name, schema]) =>
    schema.properties && !schema.nullable ? Object.entries(schema.properties).map(([inner, each]) => ({ column: inner, path: [name, inner], schema: each })) : [{ column: name, path: [name], schema }]);
}

export function toCsv(problem, fields) {
  const settings = settingsOf(fields);
  // A problem without bases has no columns of theirs.
  const kinds = Object.entries(POINTS).filter(([, list]) => problem[list]).map(([kind, list]) => ({ kind, items: problem[list], of: itemFields(fields, list) }));
  const count = Math.max(0, ...kinds.flatMap(({ items, of }) => items.flatMap((item) => amountsOf(of).map((name) => item[name]?.length ?? 0))));
  const names = (name, schema) => (isAmounts(schema) ? Array.from({ length: count }, (_, k) => `${stem(name)}_${k + 1}`) : [name]);
  const own = kinds.flatMap(({ of }) => Object.entries(of).flatMap(([name, schema]) => names(name, schema)));
  const columns = [...new Set(["kind", ...own, ...settings.map(({ column }) => column)])];
  const rows = [Object.fromEntries([["kind", "problem"], ...settings.map(({ column, path }) => [column, cell(path.reduce((at, name) => at?.[name], problem))])])];
  for (const { kind, items, of } of kinds) {
    for (const item of items) {
      const row = { kind };
      for (const [name, schema] of Object.entries(of)) {
        if (isAmounts(schema)) item[name]?.forEach((amount, k) => { row[`${stem(name)}_${k + 1}`] = amount; });
        else row[name] = isWords(schema) && item[name] ? writtenWords(item[name]) : cell(item[name]);
      }
      rows.push(row);
    }
  }
  return toCells([columns, ...rows.map((row) => columns.map((column) => row[column] ?? ""))]);
}

/** What is neither a number, a truth nor a text goes as JSON. */
function cell(value) {
  return value !== null && typeof value === "object" ? JSON.stringify(value) : (value ?? "");
}

/**
 * Read a problem.
 * @param {string} text
 * @param {object} present problem, whose settings hold where the file has none
 * @param {object} fields as `fieldsOf` gives them
 * @returns {{problem: object, notices: string[]}}
 * @throws {FormatError}
 */
export function fromCsv(text, present, fields) {
  const { separator, columns, rows } = table(text, "kind");
  const settings = settingsOf(fields);
  const reader = new Reader(columns, separator);
  const problem = { ...heldSettings(present, fields), uavs: [], targets: [] };
  let set = null;
  for (const { line, cells } of rows) {
    const kind = reader.at(cells, "kind").trim().toLowerCase();
    if (kind === "problem") {
      if (set) throw new FormatError(t("{row}: the settings stand in line {other} already", { row: rowText("line", line), other: String(set) }));
      set = line;
      for (const { column, path, schema } of settings) {
        if (!columns.includes(column)) continue;
        const [last, ...outer] = path.toReversed();
        const value = reader.value(cells, line, column, schema);
        if (outer.length) problem[outer[0]] = { ...problem[outer[0]], [last]: value };
        else problem[last] = value;
      }
    } else if (kind in POINTS) (problem[POINTS[kind]] ??= []).push(reader.item(cells, line, itemFields(fields, POINTS[kind])));
    else throw new FormatError(t("{row}: `kind` is neither {kinds} nor problem: {kind}", { row: rowText("line", line), kinds: Object.keys(POINTS).join(", "), kind: reader.at(cells, "kind") }));
  }
  const notices = reader.leftOut(rows, fields, settings);
  if (reader.numbers.comma) notices.push(t("Decimal commas were read: {text} as {number}", { text: reader.numbers.comma.text, number: reader.numbers.comma.text.replace(",", ".") }));
  return { problem, notices };
}

/** Takes values out of the rows of one file. */
class Reader {
  constructor(columns, separator) {
    this.places = new Map(columns.map((name, at) => [name, at]));
    this.numbers = new Numbers(separator);
  }

  at(cells, column) {
    return cells[this.places.get(column)] ?? "";
  }

  /** A cell's value; undefined where it is empty. */
  value(cells, line, column, schema) {
    const text = this.at(cells, column);
    if (text === "" || (schema.type !== "string" && !text.trim())) return undefined;
    if (schema.type === "number" || schema.type === "integer") return this.numbers.read(text, line, column);
    if (schema.type === "boolean") return this.#truth(text, line, column);
    if (schema.enum) return schema.enum.find((each) => String(each).toLowerCase() === text.trim().toLowerCase()) ?? this.#refuse(line, column, text, t("is none of {values}", { values: schema.enum.join(", ") }));
    if (schema.type === "string" || schema.const !== undefined) return plainText(text);
    if (isWords(schema)) return wordsIn(plainText(text)) ?? this.#refuse(line, column, text, t("is no list of words"));
    try {
      return JSON.parse(text);
    } catch {
      return this.#refuse(line, column, text, t("is no JSON"));
    }
  }

  item(cells, line, fields) {
    const item = {};
    for (const [name, schema] of Object.entries(fields)) {
      const value = isAmounts(schema) ? this.#amounts(cells, line, name, schema) : this.value(cells, line, name, schema);
      if (value !== undefined) item[name] = value;
    }
    return item;
  }

  /** Amounts at their places, zero where a cell is empty; undefined where all are and none is needed. */
  #amounts(cells, line, name, { needed }) {
    const count = this.#countOf(name);
    const columns = Array.from({ length: count }, (_, k) => `${stem(name)}_${k + 1}`);
    const missing = columns.find((column) => !this.places.has(column));
    if (missing) throw new FormatError(t("{row}: there is no column `{column}`, but one after it", { row: rowText("line", line), column: missing }));
    const texts = columns.map((column) => this.at(cells, column));
    if (!needed && texts.every((text) => !text.trim())) return undefined;
    return texts.map((text, k) => (text.trim() ? this.numbers.read(text, line, columns[k]) : 0));
  }

  /** Of amounts of a name, the highest number that a column has. */
  #countOf(name) {
    const pattern = new RegExp(`^${stem(name)}_([1-9]\\d{0,3})$`);
    return Math.max(0, ...[...this.places.keys()].map((column) => Number(pattern.exec(column)?.[1] ?? 0)));
  }

  #truth(text, line, column) {
    return TRUTHS[text.trim().toLowerCase()] ?? this.#refuse(line, column, text, t("is neither true nor false"));
  }

  #refuse(line, column, text, why) {
    throw new FormatError(t("{row}: `{column}` {why}: {text}", { row: rowText("line", line), column, why, text }));
  }

  /** Say which filled columns were not read. */
  leftOut(rows, fields, settings) {
    const known = new Set(["kind", ...settings.map(({ column }) => column)]);
    for (const list of Object.values(POINTS)) {
      for (const [name, schema] of Object.entries(itemFields(fields, list))) {
        if (!isAmounts(schema)) known.add(name);
        else for (let k = 1; k <= this.#countOf(name); k += 1) known.add(`${stem(name)}_${k}`);
      }
    }
    const left = [...this.places].filter(([name, at]) => !known.has(name) && rows.some(({ cells }) => cells[at]?.trim())).map(([name]) => name || t("one without a name"));
    return left.length ? [t("Columns that are no fields of a problem were left out: {columns}", { columns: left.join(", ") })] : [];
  }
}
