/** Lists of places as people have them, of whatever columns: which column is which field, and the items that they make. */

import { amountTitle, fieldTitle } from "../columns.js";
import { BASES, POINTS, ZONE } from "../kinds.js";
import { beyond, DEGREES, onEarth } from "../limits.js";
import { amountsOf, isWords, itemFields } from "../schema.js";
import { t } from "../texts.js";
import { wordsIn } from "../words.js";
import { list, NUMBER, Numbers, plainText, rowText } from "./cells.js";
import { FormatError } from "./error.js";
import { nameOf, onGlobe, placeOf } from "./geojson.js";
import { materialOf, mayBeAmounts, meant, plainName } from "./names.js";

/**
 * A list as it was found.
 * @typedef {{columns: string[], rows: {line: number, cells: string[]}[], separator: string, row: "line"|"feature", globe: boolean, notices: string[]}} Sheet
 *   a column without a name is ""; `row` is what a row is, `globe` whether its positions are known to be degrees
 */

/** Values of a right line, by field. */
const RIGHT = { id: "A1", name: "Dondo", y: "-19.61", x: "34.74", speed: "100", voyage: "150", level: "2" };

/**
 * Find a list of places.
 * @param {string} text of a file, or what was pasted
 * @returns {Sheet | null} null where it is a problem of this page, or no list
 * @throws {FormatError}
 */
export function sheetOf(text) {
  if (/^\s*[{[]/.test(text)) return featureSheet(text);
  const { separator, rows } = list(text);
  const columns = Math.max(0, ...rows.map(({ cells }) => cells.length));
  if (columns < 2 || rows[0].cells.some((cell) => cell.trim().toLowerCase() === "kind")) return null;
  const numeric = (cells) => cells.some(isNumber);
  const headed = !numeric(rows[0].cells) && (rows.length === 1 || rows.some(({ cells }) => numeric(cells)) || rows[0].cells.some((name) => meant(name)));
  if (!rows.slice(Number(headed)).some(({ cells }) => numeric(cells))) return null;
  const names = Array.from({ length: columns }, (_, at) => (headed ? (rows[0].cells[at] ?? "").trim() : ""));
  return { columns: names, rows: headed ? rows.slice(1) : rows, separator, row: "line", globe: false, notices: [] };
}

/** The points of a FeatureCollection none of whose features says what it is. */
function featureSheet(text) {
  let given;
  try {
    given = JSON.parse(text);
  } catch {
    return null;
  }
  const { features } = given ?? {};
  if (given?.type !== "FeatureCollection" || !Array.isArray(features) || given.settings) return null;
  const known = new Set([...Object.keys(POINTS), ZONE]);
  if (!features.length || features.some((feature) => known.has(String(feature?.properties?.kind ?? "").toLowerCase()))) return null;
  onGlobe(given.crs);
  const notices = [];
  const properties = [...new Set(features.flatMap((feature) => Object.keys(feature?.properties ?? {})))].filter((name) => !["longitude", "latitude"].includes(name));
  const rows = features.flatMap((feature, at) => {
    if (!feature?.geometry) {
      notices.push(t("{feature} has no geometry and was left out", { feature: nameOf(feature, at) }));
      return [];
    }
    const place = placeOf(feature.geometry, nameOf(feature, at), notices, true);
    return [{ line: at + 1, cells: [...place, ...properties.map((name) => feature.properties?.[name] ?? "")].map(cellText) }];
  });
  return { columns: ["longitude", "latitude", ...properties], rows, separator: ";", row: "feature", globe: true, notices };
}

function cellText(value) {
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}

function isNumber(cell) {
  return NUMBER.test(cell.trim().replace("\u2212", "-").replace(",", "."));
}

/**
 * The fields that a column can be, in their order.
 * @param {object} fields as `fieldsOf` gives them
 * @param {"uavs"|"targets"|"bases"} kind
 * @param {number} count kinds of material
 * @param {boolean} globe whether positions are degrees
 * @param {(string | undefined)[]} [materials] their names, where they have some
 * @returns {{name: string, title: string, schema: object, needed: boolean}[]} of amounts `loadlist/0`, `loadlist/1`, …
 */
export function choices(fields, kind, count, globe, materials) {
  const of = itemFields(fields, kind);
  const carried = amountsOf(of)[0];
  const taken = ([, schema]) => ["number", "integer", "string"].includes(schema.type) || isWords(schema);
  const single = Object.entries(of).filter(taken).map(([name, schema]) => ({ name, title: fieldTitle(kind, name, globe), schema: onEarth(name, schema, globe), needed: schema.needed }));
  const amounts = Array.from({ length: count }, (_, k) => ({ name: `${carried}/${k}`, title: amountTitle(kind, carried, k, globe, materials), schema: of[carried].items, needed: of[carried].needed && k === 0 }));
  return [...single, ...amounts];
}

/** What a list is of, by its columns. @param {Sheet} sheet */
export function kindOf({ columns }) {
  const fields = columns.map((name) => meant(name)?.field);
  if (fields.includes("speed") || fields.includes("voyage")) return "uavs";
  return columns.some((name) => /\b(stock|existencias)\b/i.test(name)) ? BASES : "targets";
}

/** Whether the positions of a list are degrees, as far as its names and values tell. @param {Sheet} sheet @param {(string | null)[]} assigned */
export function degreesLikely({ columns, rows, globe }, assigned) {
  if (globe) return true;
  return ["x", "y"].every((axis) => {
    const at = assigned.findIndex((name) => name === axis || name === `${axis}_s`);
    const named = at >= 0 && columns[at] && !/^[xy]$/i.test(columns[at]) && meant(columns[at])?.field === axis;
    return at < 0 || named || (rows.every(({ cells }) => !(Math.abs(valueOf(cells[at])) > DEGREES[axis])));
  });
}

function valueOf(cell = "") {
  return Number(cell.trim().replace("\u2212", "-").replace(",", "."));
}

/** Whether a field is one amount of a material. @param {string | null} name as `choices` gives it */
function isAmount(name) {
  return Boolean(name?.includes("/"));
}

/**
 * The names of the materials that a list brings.
 * @param {Sheet} sheet
 * @param {(string | null)[]} assigned a field a column
 * @param {(string | undefined)[]} before names that materials have already, and keep
 * @returns {(string | undefined)[]} by material; a name that another column has too is with what is in brackets behind it
 */
export function materialsOf({ columns }, assigned, before) {
  const names = [...before];
  const short = columns.map(materialOf);
  const twice = (at) => short.some((name, other) => other !== at && isAmount(assigned[other]) && plainName(name) === plainName(short[at]));
  columns.forEach((column, at) => {
    if (!isAmount(assigned[at])) return;
    const k = Number(assigned[at].split("/")[1]);
    names[k] ||= short[at] && (twice(at) ? column : short[at]) || undefined;
  });
  return Array.from(names);
}

/**
 * Fields that are needed and that no column is. An amount of one material is enough: of the others there is none.
 * @param {ReturnType<typeof choices>} known fields
 * @param {(string | null)[]} assigned a field a column
 */
export function missingOf(known, assigned) {
  return known.filter(({ name, needed }) => needed && !assigned.includes(name) && !(isAmount(name) && assigned.some(isAmount)));
}

/** Columns that are no field and have something in a row: their names, or their numbers from 1. @param {Sheet} sheet @param {(string | null)[]} assigned @returns {string[]} */
export function leftOut({ columns, rows }, assigned) {
  return columns.flatMap((column, at) => (assigned[at] === null && rows.some(({ cells }) => (cells[at] ?? "").trim()) ? [column || String(at + 1)] : []));
}

/**
 * Guess what the columns are.
 * @param {Sheet} sheet
 * @param {ReturnType<typeof choices>} known fields, with more amounts than the list has columns
 * @param {(string | undefined)[]} [materials] names of materials that there are already; columns named so are their amounts
 * @returns {(string | null)[]} a field a column, each once
 */
export function guess({ columns, rows }, known, materials = []) {
  const names = new Set(known.map(({ name }) => name));
  const place = (axis) => [axis, `${axis}_s`].find((name) => names.has(name));
  const carried = known.find(({ name }) => name.endsWith("/0"))?.name.slice(0, -2);
  const assigned = columns.map(() => null);
  const assign = (at, name) => { if (at >= 0 && name && names.has(name) && !assigned.includes(name)) assigned[at] = name; };
  const own = columns.map(materialOf);
  const placeOfMaterial = (at) => materials.findIndex((name) => name && own[at] && plainName(name) === plainName(own[at]));
  // A material of another name than those that there are is one more.
  const free = (at) => known.find(({ name }) => name.startsWith(`${carried}/`) && !assigned.includes(name) && !(own[at] && materials[Number(name.split("/")[1])]))?.name;
  const amounts = (at) => { const k = placeOfMaterial(at); assign(at, k >= 0 ? `${carried}/${k}` : free(at)); };
  columns.forEach((column, at) => { if (mayBeAmounts(column) && placeOfMaterial(at) >= 0 && holds(at, isNumber)) amounts(at); });
  columns.forEach((column, at) => {
    if (assigned[at] !== null) return;
    if (names.has(column.toLowerCase())) return assign(at, column.toLowerCase());
    const { field, number } = meant(column) ?? {};
    if (field === "x" || field === "y") assign(at, place(field));
    else if (field === "amount") { if (number) assign(at, `${carried}/${number - 1}`); else amounts(at); }
    else assign(at, field);
  });
  // What the names do not say, the values may: a text is a name, two numbers are latitude and longitude, in this order.
  const share = (at, holds) => rows.filter(({ cells }) => holds((cells[at] ?? "").trim())).length / Math.max(1, rows.length);
  const left = (holds) => columns.findIndex((column, at) => assigned[at] === null && (!column || !meant(column)) && share(at, holds) > 0.8);
  if (!assigned.includes("name") && !assigned.includes("id")) assign(left((cell) => cell && !isNumber(cell)), "name");
  const headless = columns.every((column) => !column);
  const coordinate = headless ? isNumber : (cell) => isNumber(cell) && /[.,]\d/.test(cell);
  if (!assigned.includes(place("x")) && !assigned.includes(place("y"))) {
    const first = left(coordinate);
    const wide = first >= 0 && rows.some(({ cells }) => Math.abs(valueOf(cells[first])) > DEGREES.y);
    assign(first, place(wide ? "x" : "y"));
    assign(left(coordinate), place(wide ? "y" : "x"));
  }
  // A column that is called a need and names no material is all that is needed; else each one of numbers is a material.
  if (columns.some((column, at) => isAmount(assigned[at]) && !own[at])) return assigned;
  columns.forEach((column, at) => { if (assigned[at] === null && mayBeAmounts(column) && holds(at, isNumber)) amounts(at); });
  return assigned;

  /** Whether all that is filled in of a column is so, and something is. */
  function holds(at, so) {
    const filled = rows.map(({ cells }) => (cells[at] ?? "").trim()).filter(Boolean);
    return filled.length > 0 && filled.every(so);
  }
}

/**
 * The items of a list.
 * @param {Sheet} sheet
 * @param {(string | null)[]} assigned a field a column
 * @param {ReturnType<typeof choices>} known fields
 * @param {Record<string, number | string>} otherwise values of fields that no column has, or whose cell is empty
 * @returns {{items: object[], faults: string[]}} items of the rows without a fault; each fault names row and column
 */
export function itemsOf({ columns, rows, separator, row }, assigned, known, otherwise) {
  const fields = assigned.map((name) => known.find((each) => each.name === name) ?? null);
  const missing = missingOf(known, assigned).filter(({ name }) => otherwise[name] === undefined);
  if (missing.length) return { items: [], faults: [t("No column is {fields}: choose it above", { fields: missing.map(({ title }) => title).join(", ") })] };
  const numbers = new Numbers(separator, row);
  const amount = known.find(({ name, needed }) => needed && isAmount(name));
  const faults = [];
  const items = rows.flatMap(({ line, cells }) => {
    try {
      const item = {};
      for (const { name } of known) if (otherwise[name] !== undefined) put(item, name, otherwise[name]);
      fields.forEach((field, at) => {
        if (!field) return;
        const value = read((cells[at] ?? "").trim(), field, line, columns[at] ? `${field.title} (${columns[at]})` : field.title);
        if (value !== undefined) put(item, field.name, value);
        else if (field.needed && !isAmount(field.name) && otherwise[field.name] === undefined) refuseEmpty(line, field.title);
      });
      if (amount && !item[amount.name.split("/")[0]]) refuseEmpty(line, fields.find((field) => isAmount(field?.name)).title);
      return [item];
    } catch (error) {
      if (!(error instanceof FormatError)) throw error;
      faults.push(error.message);
      return [];
    }
  });
  return { items, faults };

  function read(text, { schema }, line, column) {
    if (text === "") return undefined;
    if (isWords(schema)) return wordsIn(plainText(text)) ?? refuse(line, column, text, t("a list of words, such as medic; night flight, is needed"));
    if (schema.type === "string") return plainText(text);
    const value = numbers.read(text, line, column);
    const limit = beyond(value, schema);
    if (limit) refuse(line, column, text, limit);
    return value;
  }

  function refuseEmpty(line, column) {
    throw new FormatError(t("{row}: `{column}` is empty", { row: rowText(row, line), column }));
  }

  function refuse(line, column, text, why) {
    throw new FormatError(t("{row}: `{column}` is {text}: {why}", { row: rowText(row, line), column, text, why }));
  }
}

/** Set a field, or one amount of it. */
function put(item, name, value) {
  const [field, k] = name.split("/");
  if (k === undefined) item[field] = value;
  else {
    const amounts = (item[field] ??= []);
    while (amounts.length <= Number(k)) amounts.push(0);
    amounts[Number(k)] = value;
  }
}

/** A right row of the columns of a list, as an example. @param {Sheet} sheet @param {(string | null)[]} assigned */
export function rightRow({ rows, separator }, assigned) {
  const comma = separator !== "," && rows.some(({ cells }) => cells.some((cell) => /^[+-]?\d+,\d+$/.test(cell.trim())));
  const values = assigned.map((name) => (name === null ? "…" : (RIGHT[name.replace("_s", "")] ?? (name.includes("/") ? "20" : "1"))));
  return values.map((value) => (comma ? value.replace(".", ",") : value)).join(separator === "\t" ? "   " : separator);
}
