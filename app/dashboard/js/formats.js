/** A problem as JSON, CSV and GeoJSON, out and in again without loss; other people's files as they are found. */

import { FormatError } from "./formats/error.js";
import { fromCsv, toCsv } from "./formats/csv.js";
import { fromGeoJson, toGeoJson } from "./formats/geojson.js";
import { sheetOf } from "./formats/places.js";
import { textOf } from "./formats/text.js";
import { BASES } from "./kinds.js";
import { baseName } from "./plan.js";
import { normalised } from "./problem.js";
import { itemFields, wanted } from "./schema.js";
import { t, tn } from "./texts.js";

export { FormatError, toCsv, toGeoJson };

const CALLED = { uavs: (name) => t("UAV {name}", { name }), targets: (name) => t("area {name}", { name }), [BASES]: baseName };
const RENAMED = {
  uavs: (count, ids) => tn(count, "{count} UAV has an id that stood before and was numbered: {ids}", "{count} UAVs have ids that stood before and were numbered: {ids}", { ids }),
  targets: (count, ids) => tn(count, "{count} area has an id that stood before and was numbered: {ids}", "{count} areas have ids that stood before and were numbered: {ids}", { ids }),
  [BASES]: (count, ids) => tn(count, "{count} base has an id that stood before and was numbered: {ids}", "{count} bases have ids that stood before and were numbered: {ids}", { ids }),
};

export function toJson(problem) {
  return `${JSON.stringify(problem, null, 2)}\n`;
}

/**
 * Find a list of places in a file.
 * @param {Uint8Array} bytes
 * @returns {import("./formats/places.js").Sheet | null} null where it is a problem of any of the formats, or no list
 * @throws {FormatError}
 */
export function readList(bytes) {
  const { text, notices } = textOf(bytes);
  const sheet = sheetOf(text);
  return sheet && { ...sheet, notices: [...notices, ...sheet.notices] };
}

/**
 * Read a file of any of the formats.
 * @param {Uint8Array} bytes
 * @param {object} present problem, whose settings hold where the file has none
 * @param {object} fields as `fieldsOf` gives them
 * @returns {{problem: object, notices: string[]}} what is told besides is in `notices`
 * @throws {FormatError}
 */
export function read(bytes, present, fields) {
  const { text, notices } = textOf(bytes);
  const found = /^\s*[{[]/.test(text) ? fromJson(text, present, fields) : fromCsv(text, present, fields);
  const told = [...notices, ...found.notices];
  return { problem: complete(found.problem, fields, told), notices: told };
}

function fromJson(text, present, fields) {
  let given;
  try {
    given = JSON.parse(text);
  } catch (error) {
    throw new FormatError(t("this is no JSON: {why}", { why: error.message }));
  }
  if (given.type === "FeatureCollection") return fromGeoJson(given, present, fields);
  if (!Array.isArray(given.uavs) || !Array.isArray(given.targets)) throw new FormatError(t("it has no lists `uavs` and `targets`, and is no FeatureCollection"));
  const problem = Object.fromEntries(Object.entries(given).filter(([name]) => !(name in fields.request)));
  return { problem, notices: [] };
}

/** What the page needs to show a problem: fields that it has, of their kinds. Their limits are for the service to judge. */
function complete(problem, fields, notices) {
  const unknown = new Set();
  const checked = (object, known, what) => {
    if (!object || typeof object !== "object" || Array.isArray(object)) throw new FormatError(t("{what} is no object", { what }));
    const kept = {};
    for (const [name, value] of Object.entries(object)) {
      if (value === null || value === undefined) continue;
      if (!(name in known)) unknown.add(name);
      else {
        const want = wanted(value, known[name]);
        if (want) throw new FormatError(t("{what}: `{field}` is {value}, {needed} is needed", { what, field: name, value: JSON.stringify(value), needed: want }));
        kept[name] = known[name].properties ? checked(value, known[name].properties, name) : value;
      }
    }
    return kept;
  };
  const items = (kind) => {
    const known = itemFields(fields, kind);
    const found = problem[kind].map((item, at) => {
      const named = typeof item?.id === "number" ? { ...item, id: String(item.id) } : item;
      const name = CALLED[kind](String(named?.id ?? at + 1));
      const kept = checked(named, known, name);
      const missing = Object.keys(known).find((field) => known[field].needed && !(field in kept));
      if (missing) throw new FormatError(t("{what} has no `{field}`", { what: name, field: missing }));
      return kept;
    });
    return distinct(found, kind, known.id.maxLength, notices);
  };
  const { uavs, targets, ...settings } = problem;
  const whole = { ...checked(settings, fields.settings, t("the problem")), uavs: items("uavs"), targets: items("targets") };
  if (whole[BASES]) whole[BASES] = items(BASES);
  if (unknown.size) notices.push(t("Fields that the service does not know were left out: {fields}", { fields: [...unknown].join(", ") }));
  return normalised(whole);
}

/** Number ids that are there before, as ids have to differ. @param {"uavs"|"targets"|"bases"} kind of the items */
export function distinct(items, kind, longest, notices) {
  const taken = new Set(items.map(({ id }) => id));
  const seen = new Set();
  const renamed = [];
  const numbered = items.map((item) => {
    const { id } = item;
    if (id === undefined || !seen.has(id)) {
      seen.add(id);
      return item;
    }
    let other = id;
    for (let n = 2; taken.has(other); n += 1) {
      const tail = ` (${n})`;
      other = [...id].slice(0, longest - tail.length).join("") + tail;
    }
    taken.add(other);
    seen.add(other);
    renamed.push(other);
    return { ...item, id: other };
  });
  if (renamed.length) notices.push(RENAMED[kind](renamed.length, `${renamed.slice(0, 5).join(", ")}${renamed.length > 5 ? " …" : ""}`));
  return numbered;
}
