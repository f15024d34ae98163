/** Cells of a CSV file (RFC 4180, and what programs write instead) and their numbers and texts. */

import { t } from "../texts.js";
import { FormatError } from "./error.js";

/** Separators that are looked for, in this order. */
const SEPARATORS = [",", ";", "\t", "|"];
/** What a spreadsheet takes for a formula; such a text gets an apostrophe in front, and one more where it has some. */
const FORMULA = /^'*[=+\-@\t\r]/;
const ESCAPED = /^'+[=+\-@\t\r]/;
export const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;

/** What a row of a file is called. @param {"line"|"feature"} row @param {number} number of it, from 1 */
export function rowText(row, number) {
  return row === "feature" ? t("feature {number}", { number: String(number) }) : t("line {number}", { number: String(number) });
}

/** Write rows of values; texts are kept from becoming formulas. @param {(string | number | boolean)[][]} rows */
export function toCells(rows) {
  return rows.map((cells) => cells.map(written).join(",")).join("\r\n").concat("\r\n");
}

function written(value) {
  let text = String(value);
  if (typeof value === "string" && FORMULA.test(text)) text = `'${text}`;
  return /[",;|\t\r\n]|^\s|\s$/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** A text as it was before it was kept from becoming a formula. */
export function plainText(text) {
  return ESCAPED.test(text) ? text.slice(1) : text;
}

/**
 * Rows of a table whose first line names its columns.
 * @param {string} text
 * @param {string} needed a column that has to be there
 * @returns {{separator: string, columns: string[], rows: {line: number, cells: string[]}[]}} columns in lower case;
 *   lines are those of the file, from 1; blank rows and a row of HXL tags are left out
 * @throws {FormatError}
 */
export function table(text, needed) {
  const { separator: told, body, before } = toldSeparator(text);
  const separator = told ?? separatorOf(body, needed);
  const [head, ...rows] = filled(rowsOf(body, separator, before));
  if (!head) throw new FormatError(t("it is empty"));
  const columns = head.cells.map((name) => name.trim().toLowerCase());
  if (!columns.includes(needed)) {
    const names = columns.filter(Boolean).slice(0, 8).join(", ");
    throw new FormatError(t("{row}: it has to name the columns, and `{column}` is not among them (found: {names})", { row: rowText("line", head.line), column: needed, names }));
  }
  const twice = columns.find((name, at) => name && columns.indexOf(name) !== at);
  if (twice) throw new FormatError(t("{row}: two columns are named `{column}`", { row: rowText("line", head.line), column: twice }));
  for (const { line, cells } of rows) {
    if (cells.slice(columns.length).some((cell) => cell.trim())) throw new FormatError(t("{row}: it has {cells} cells for {columns} columns", { row: rowText("line", line), cells: cells.length, columns: columns.length }));
  }
  return { separator, columns, rows: rows.filter(({ cells }) => !isTags(cells)) };
}

/** Separators of a list whose columns have no names that are known: a comma may be one of decimals. */
const LIST_SEPARATORS = ["\t", ";", "|", ","];
const LOOKED_AT = 50;

/**
 * Rows of a list of whatever columns.
 * @param {string} text
 * @returns {{separator: string, rows: {line: number, cells: string[]}[]}} without blank rows and a row of HXL tags
 * @throws {FormatError} where a quote is out of place
 */
export function list(text) {
  const told = toldSeparator(text);
  const separator = told.separator ?? LIST_SEPARATORS.map((each) => ({ each, evenness: evenness(told.body, each) })).reduce((a, b) => (b.evenness > a.evenness ? b : a)).each;
  return { separator, rows: filled(rowsOf(told.body, separator, told.before)).filter(({ cells }) => !isTags(cells)) };
}

/** The share of the first rows that have as many cells as most of them, of two or more. */
function evenness(text, separator) {
  const rows = filled(rowsOf(text, separator, 0, true), LOOKED_AT);
  const counts = new Map();
  for (const { cells: { length } } of rows) if (length > 1) counts.set(length, (counts.get(length) ?? 0) + 1);
  return Math.max(0, ...counts.values()) / Math.max(1, rows.length);
}

function filled(rows, most = Infinity) {
  const kept = [];
  for (const row of rows) {
    if (row.cells.some((cell) => cell.trim())) kept.push(row);
    if (kept.length >= most) break;
  }
  return kept;
}

/** The separator that a first line `sep=` names, and what comes after that line. */
function toldSeparator(text) {
  const told = /^\s*"?sep=(.)"?[ \t]*(\r\n|\n|\r)/i.exec(text);
  if (!told) return { separator: null, body: text, before: 0 };
  return { separator: told[1], body: text.slice(told[0].length), before: told[0].split(/\r\n|\n|\r/).length - 1 };
}

/** A row that humanitarian data has below the names (HXL): each cell that is filled is a tag. */
function isTags(cells) {
  const filled = cells.filter((cell) => cell.trim());
  return filled.every((cell) => /^\s*#[a-z]/i.test(cell));
}

function separatorOf(text, needed) {
  const heads = SEPARATORS.map((separator) => {
    for (const { cells } of rowsOf(text, separator, 0, true)) if (cells.some((cell) => cell.trim())) return { separator, cells };
    return { separator, cells: [] };
  });
  const names = ({ cells }) => cells.some((cell) => cell.trim().toLowerCase() === needed);
  return (heads.find(names) ?? heads.reduce((a, b) => (b.cells.length > a.cells.length ? b : a))).separator;
}

/** Rows with the line they begin at; a cell in quotes keeps its spaces. @param {boolean} lax ends quietly where it cannot go on */
function* rowsOf(text, separator, before, lax = false) {
  const apart = separator.replace(/[|\\^$.*+?()[\]{}]/g, "\\$&");
  const pattern = new RegExp(`(?: *"((?:[^"]|"")*)" *|([^"${apart}\\r\\n]*))(${apart}|\\r\\n|\\n|\\r|$)`, "gy");
  let line = before + 1;
  let row = { line, cells: [] };
  for (let found = pattern.exec(text); found; found = pattern.exec(text)) {
    const [, quoted, bare, end] = found;
    row.cells.push(quoted === undefined ? bare.trim() : quoted.replaceAll('""', '"'));
    line += quoted?.match(/\r\n|\n|\r/g)?.length ?? 0;
    if (end === separator) continue;
    yield row;
    if (end === "") return;
    line += 1;
    row = { line, cells: [] };
  }
  if (!lax) throw new FormatError(t("{row}: a quote is out of place", { row: rowText("line", line) }));
}

/** Reads the numbers of one file, whose decimals are either all points or all commas. */
export class Numbers {
  /** @param {string} separator of the file's cells @param {"line"|"feature"} [row] what a row of it is */
  constructor(separator, row = "line") {
    this.separator = separator;
    this.row = row;
    this.point = null;
    this.comma = null;
  }

  /** @throws {FormatError} where a cell is no number */
  read(text, line, column) {
    const cell = { text: text.trim(), line, column };
    const plain = cell.text.replace("\u2212", "-");
    const decimal = /[.,]/.exec(plain)?.[0];
    if (decimal === ",") {
      if (this.separator === ",") this.#refuse(cell, t("has a decimal comma, in a file with commas between the cells"));
      this.comma ??= cell;
    } else if (decimal === ".") this.point ??= cell;
    if (decimal && this.point && this.comma) {
      const other = decimal === "," ? this.point : this.comma;
      const there = { row: rowText(this.row, other.line), number: other.text };
      this.#refuse(cell, decimal === "," ? t("is ambiguous: {row} has a decimal point, {number}", there) : t("is ambiguous: {row} has a decimal comma, {number}", there));
    }
    const value = decimal === "," ? plain.replace(",", ".") : plain;
    if (!NUMBER.test(value) || !Number.isFinite(Number(value))) this.#refuse(cell, t("is no number"));
    return Number(value);
  }

  #refuse({ text, line, column }, why) {
    throw new FormatError(t("{row}: `{column}` {why}: {text}", { row: rowText(this.row, line), column, why, text }));
  }
}
