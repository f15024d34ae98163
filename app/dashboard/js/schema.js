/** What the service says of a problem's fields in `/openapi.json`: the page has no list of its own. */

import { t } from "./texts.js";

/** Take out references and the null of what may be left open. */
export function resolved(schema, defs) {
  const found = schema.$ref ? { ...defs[schema.$ref.split("/").at(-1)], ...schema } : schema;
  const open = found.anyOf?.filter((each) => each.type !== "null");
  return open?.length ? { ...found, ...resolved(open[0], defs), nullable: true, default: found.default, description: found.description } : found;
}

/**
 * The fields of a problem, and the algorithms that learn.
 * @param {object} openapi the document
 * @returns {{learners: string[], uavs: object, targets: object, settings: object, request: object, mission: object}} JSON schemas by name,
 *   references taken out: of a UAV, of an area (`needed`: it has no default), of the problem besides its lists, and of `POST /allocate` and
 *   `POST /missions` besides the problem
 */
export function fieldsOf(openapi) {
  const defs = openapi.components.schemas;
  const all = (properties) => Object.fromEntries(Object.entries(properties).map(([name, schema]) => [name, resolved(schema, defs)]));
  const { uavs, targets, ...settings } = all(defs.ProblemModel.properties);
  const item = (list) => {
    const { properties, required = [] } = resolved(list.items, defs);
    return Object.fromEntries(Object.entries(all(properties)).map(([name, schema]) => [name, { ...schema, needed: required.includes(name) }]));
  };
  const request = Object.entries(all(defs.AllocationRequest.properties)).filter(([name]) => !(name in defs.ProblemModel.properties));
  for (const [name, schema] of Object.entries(settings)) {
    if (schema.properties) settings[name] = { ...schema, properties: all(schema.properties) };
    else if (schema.items?.$ref) settings[name] = { ...schema, items: { properties: item(schema) } };
  }
  const learners = defs.TrainingModel.properties.algorithm.enum;
  const { problem: _, ...mission } = all(defs.MissionRequest.properties);
  return { learners, uavs: item(uavs), targets: item(targets), settings, request: Object.fromEntries(request), mission };
}

/** JSON schemas of the fields of an item of a list of the problem. @param {object} fields as `fieldsOf` gives them */
export function itemFields(fields, list) {
  return fields[list] ?? fields.settings[list].items.properties;
}

/** Whether a field holds one amount a material. */
export function isAmounts(schema) {
  return schema.type === "array" && ["number", "integer"].includes(schema.items?.type);
}

/** Whether a field holds a list of words, or of ids. */
export function isWords(schema) {
  return schema.type === "array" && schema.items?.type === "string";
}

/** Whether a field is a 1 or a 0 that says yes or no. */
export function isFlag(schema) {
  return schema.type === "integer" && schema.minimum === 0 && schema.maximum === 1;
}

/** Whether a field holds ids of the items of a list. */
export function isIdsOf(schema, list) {
  return isWords(schema) && schema.idsOf === list;
}

/** Settings that are of no items, and so hold for another problem too: one value each, or an object of such. */
export function heldSettings(problem, fields) {
  const held = ([, schema]) => schema.type !== "array" && (schema.type !== "object" || schema.properties);
  const names = new Set(Object.entries(fields.settings).filter(held).map(([name]) => name));
  return Object.fromEntries(Object.entries(problem).filter(([name]) => names.has(name)));
}

/** Names of the fields that hold one amount a material, of those of an item. */
export function amountsOf(fields) {
  return Object.keys(fields).filter((name) => isAmounts(fields[name]));
}

/** What a value has to be, where it is not that; null where it is. */
export function wanted(value, schema) {
  if (schema.enum) return schema.enum.includes(value) ? null : t("one of {values}", { values: schema.enum.join(", ") });
  if (schema.const !== undefined) return value === schema.const ? null : String(schema.const);
  if (schema.type === "number" || schema.type === "integer") return Number.isFinite(value) ? null : t("a number");
  if (schema.type === "boolean") return typeof value === "boolean" ? null : t("true or false");
  if (schema.type === "string") return typeof value === "string" ? null : t("a text");
  if (isAmounts(schema)) return Array.isArray(value) && value.every(Number.isFinite) ? null : t("a list of numbers");
  if (isWords(schema)) return Array.isArray(value) && value.every((word) => typeof word === "string") ? null : t("a list of texts");
  if (schema.type === "array") return Array.isArray(value) ? null : t("a list");
  if (schema.type === "object") return value && typeof value === "object" && !Array.isArray(value) ? null : t("an object");
  return null;
}
