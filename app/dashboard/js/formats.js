/** A problem as JSON, CSV and GeoJSON, out and in again without loss. */

import { normalised, position } from "./problem.js";

const UAV_NUMBERS = ["x_s", "y_s", "x_c", "y_c", "speed", "voyage", "dis", "ret"];
const TARGET_NUMBERS = ["x", "y", "level", "deadline", "service_time"];
const SETTINGS = ["max_steps", "crs", "distance_weight", "return_to_base", "charge_return"];
const PROBLEM_FIELDS = ["uavs", "targets", "max_steps", "crs", "objective"];

/** A file that cannot be read, with the place in it. */
export class FormatError extends Error {}

export function toJson(problem) {
  return `${JSON.stringify(problem, null, 2)}\n`;
}

/** One row an item, and one of `kind` problem for the settings. */
export function toCsv(problem) {
  const count = Math.max(0, ...[...problem.uavs, ...problem.targets].map((item) => item.loadlist.length));
  const loads = Array.from({ length: count }, (_, k) => `load_${k + 1}`);
  const columns = ["kind", "id", ...UAV_NUMBERS, ...TARGET_NUMBERS, ...loads, ...SETTINGS];
  const flat = ({ loadlist, ...fields }) => ({ ...fields, ...Object.fromEntries(loadlist.map((n, k) => [loads[k], n])) });
  const rows = [
    { kind: "problem", max_steps: problem.max_steps, crs: problem.crs, ...problem.objective },
    ...problem.uavs.map((uav) => ({ kind: "uav", ...flat(uav) })),
    ...problem.targets.map((target) => ({ kind: "area", ...flat(target) })),
  ];
  return [columns, ...rows.map((row) => columns.map((column) => row[column] ?? ""))]
    .map((cells) => cells.map(quoted).join(","))
    .join("\r\n")
    .concat("\r\n");
}

function quoted(value) {
  const text = String(value);
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** Points with the API's fields as properties; the settings are a member of the collection. */
export function toGeoJson(problem) {
  const { uavs, targets, ...settings } = problem;
  const point = ({ x, y }, kind, { id, ...properties }) => ({
    type: "Feature", id, geometry: { type: "Point", coordinates: [x, y] }, properties: { kind, ...properties },
  });
  const features = [
    ...uavs.map((uav) => point(position(uav), "uav", uav)),
    ...targets.map((target) => point(target, "area", target)),
  ];
  return `${JSON.stringify({ type: "FeatureCollection", settings, features }, null, 2)}\n`;
}

/**
 * Read a file of any of the formats.
 * @param {string} text
 * @param {object} present problem, whose settings hold where the file has none
 * @throws {FormatError}
 */
export function read(text, present) {
  const trimmed = text.replace(/^\uFEFF/, "").trim();
  if (!trimmed.startsWith("{")) return fromCsv(trimmed, present);
  let given;
  try {
    given = JSON.parse(trimmed);
  } catch (error) {
    throw new FormatError(`this is no JSON: ${error.message}`);
  }
  if (given.type === "FeatureCollection") return fromGeoJson(given, present);
  if (!Array.isArray(given.uavs) || !Array.isArray(given.targets)) throw new FormatError("it has no lists `uavs` and `targets`");
  return complete(Object.fromEntries(PROBLEM_FIELDS.filter((name) => name in given).map((name) => [name, given[name]])));
}

/** What the page needs to show a problem; all else is for the service to judge. */
function complete(problem) {
  const check = (items, fields, what) => {
    items.forEach((item, at) => {
      const name = `${what} ${item?.id ?? at + 1}`;
      for (const field of fields) if (!Number.isFinite(item?.[field])) throw new FormatError(`${name} has no number \`${field}\``);
      if (!Array.isArray(item.loadlist)) throw new FormatError(`${name} has no \`loadlist\``);
    });
    const ids = items.map((item) => item.id).filter((id) => id !== undefined && id !== null);
    const twice = ids.find((id, at) => ids.indexOf(id) !== at);
    if (twice !== undefined) throw new FormatError(`two of the ${what}s have the id ${twice}`);
  };
  check(problem.uavs, ["x_s", "y_s", "speed", "voyage"], "UAV");
  check(problem.targets, ["x", "y", "level"], "area");
  return normalised(problem);
}

function fromGeoJson({ features = [], settings = {} }, present) {
  const { uavs: _u, targets: _t, ...held } = present;
  const problem = { ...held, ...settings, uavs: [], targets: [] };
  if (!Object.keys(settings).length) problem.crs = "wgs84";
  features.forEach((feature, at) => {
    const { kind, ...fields } = feature.properties ?? {};
    const [x, y] = feature.geometry?.type === "Point" ? feature.geometry.coordinates : [];
    if (x === undefined) throw new FormatError(`feature ${at + 1} is no point`);
    const id = feature.id === undefined ? {} : { id: String(feature.id) };
    if (kind === "uav") problem.uavs.push({ x_s: x, y_s: y, ...fields, ...id });
    else if (kind === "area") problem.targets.push({ ...fields, x, y, ...id });
    else throw new FormatError(`feature ${at + 1} has a \`kind\` that is neither uav nor area`);
  });
  return complete(problem);
}

function fromCsv(text, present) {
  const [columns, ...rows] = cellsOf(text);
  if (!columns?.includes("kind")) throw new FormatError("the first line of a CSV names the columns, `kind` among them");
  const { uavs: _u, targets: _t, ...held } = present;
  const problem = { ...held, uavs: [], targets: [] };
  rows.forEach((cells, at) => {
    const line = at + 2;
    const row = Object.fromEntries(columns.map((column, i) => [column.trim(), (cells[i] ?? "").trim()]));
    if (row.kind === "problem") Object.assign(problem, settingsOf(row));
    else if (row.kind === "uav") problem.uavs.push(itemOf(row, UAV_NUMBERS, line));
    else if (row.kind === "area") problem.targets.push(itemOf(row, TARGET_NUMBERS, line));
    else throw new FormatError(`line ${line}: \`kind\` is neither uav, area nor problem`);
  });
  return complete(problem);
}

function settingsOf(row) {
  const truth = (text) => text.toLowerCase() === "true";
  return {
    ...(row.max_steps ? { max_steps: Number(row.max_steps) } : {}),
    ...(row.crs ? { crs: row.crs } : {}),
    objective: {
      distance_weight: row.distance_weight ? Number(row.distance_weight) : null,
      ...(row.return_to_base ? { return_to_base: truth(row.return_to_base) } : {}),
      ...(row.charge_return ? { charge_return: truth(row.charge_return) } : {}),
    },
  };
}

function itemOf(row, numbers, line) {
  const item = row.id ? { id: row.id } : {};
  const take = (column) => {
    const value = Number(row[column]);
    if (!Number.isFinite(value)) throw new FormatError(`line ${line}: \`${column}\` is no number: ${row[column]}`);
    return value;
  };
  for (const column of numbers) if (row[column]) item[column] = take(column);
  item.loadlist = Object.keys(row).filter((column) => /^load_\d+$/.test(column) && row[column]).map(take);
  return item;
}

/** Rows of cells, quotes and line ends as RFC 4180 has them. */
function cellsOf(text) {
  const rows = [[]];
  const pattern = /(?:"((?:[^"]|"")*)"|([^",\r\n]*))(,|\r?\n|$)/gy;
  for (let found = pattern.exec(text); found; found = pattern.exec(text)) {
    rows.at(-1).push(found[1] === undefined ? found[2] : found[1].replaceAll('""', '"'));
    if (found[3] === "") return rows.filter((cells) => cells.some((cell) => cell.trim()));
    if (found[3] !== ",") rows.push([]);
  }
  throw new FormatError(`line ${rows.length}: a quote is out of place`);
}
