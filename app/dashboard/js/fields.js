/** Form fields made from JSON schemas, as the service describes its parameters. */

import { h } from "./dom.js";
import { NO_LIMIT, TINY } from "./limits.js";
import { resolved } from "./schema.js";
import { ofService, plainNumber, t, writtenNumber } from "./texts.js";

/**
 * Fields of an object's schema.
 * @param {Record<string, object>} properties JSON schemas by name
 * @param {{pointer: string, values?: object, defs?: object, titles?: object, globe?: boolean, onchange?: () => void}} options
 *   pointer is the JSON pointer of the object in the request, by which refusals find the field; `globe`: times are hours, lengths
 *   kilometres and positions degrees
 */
export class Fields {
  constructor(properties, { pointer, values = {}, defs = {}, titles = {}, globe = false, onchange = () => {} }) {
    this.fields = Object.entries(properties).map(([name, schema]) => makeField(name, resolved(schema, defs), { pointer: `${pointer}/${name}`, value: values[name], title: titles[name], globe, onchange }));
    this.element = h("div", { class: "fields" }, this.fields.map((field) => field.element));
  }

  /** What was filled in, without what is the default anyway. */
  values() {
    return Object.fromEntries(this.fields.map((field) => [field.name, field.read()]).filter(([, value]) => value !== undefined));
  }
}

/** Show refusals at the fields of a form; return those that belong to none of them. */
export function showViolations(root, violations) {
  for (const place of root.querySelectorAll("label[data-pointer]")) setError(place, null);
  return violations.filter(({ pointer, detail }) => {
    const place = root.querySelector(`label[data-pointer="${CSS.escape(pointer)}"]`);
    if (place) setError(place, detail);
    return !place;
  });
}

function setError(place, detail) {
  const input = place.querySelector("input, select");
  const shown = place.querySelector(".error");
  input.toggleAttribute("aria-invalid", Boolean(detail));
  if (detail) input.setAttribute("aria-invalid", "true");
  shown.textContent = detail ?? "";
  shown.hidden = !detail;
}

let labels = 0;

/** A labelled place for an input, where a refusal of its pointer is shown. */
export function labelled(title, input, { pointer, hint } = {}) {
  labels += 1;
  const id = `error-${labels}`;
  input.setAttribute("aria-describedby", id);
  return h("label", { dataset: pointer ? { pointer } : {} }, title, input, hint && h("span", { class: "hint" }, hint), h("span", { class: "error", id, hidden: true }));
}

function makeField(name, schema, { pointer, value, title = labelOf(name), globe, onchange }) {
  const given = value ?? schema.default;
  const input = inputFor(schema, given);
  input.name = name;
  input.addEventListener("change", onchange);
  const element = labelled(title, input, { pointer, hint: [hintOf(schema, globe), range(schema)].filter(Boolean).join(". ") });
  return { name, element, read: () => valueOf(schema, input) };
}

/**
 * The description of a field in the language of the page, for people: a field that is left empty is null to the API.
 * @param {object} schema @param {boolean} globe leave the units of a plane out
 */
function hintOf({ description }, globe) {
  const english = forPeople(description, globe);
  return ofService("fields", english) ?? english;
}

/** A description in English, which is the key of its translations. */
export function forPeople(description, globe) {
  const said = description?.replaceAll("null:", "empty:").replaceAll("`", "");
  if (!globe) return said;
  return said?.replace(/\b(?:distance units per time unit|distance units|time units|[xy]), or (?=km\/h|km|h\b|longitude|latitude)/g, "").replaceAll("time units", "hours");
}

/** A parameter's name for people: `time_limit_s` is “Time limit, s”. */
export function titleOf(name) {
  const text = name.replace(/_s$/, ", s").replaceAll("_", " ");
  return asLabel(text);
}

/** The same in the language of the page. */
export function labelOf(name) {
  return t(titleOf(name));
}

/** A text of a line as it stands alone. */
export function asLabel(text) {
  return text[0].toUpperCase() + text.slice(1);
}

/** A label as it stands in a line. */
export function inLine(label) {
  return label[0].toLowerCase() + label.slice(1);
}

function inputFor(schema, given) {
  const choices = schema.enum ?? (schema.type === "boolean" ? [true, false] : null);
  if (choices) {
    const shown = [...(schema.nullable ? [["", t("by itself")]] : []), ...choices.map((each) => [String(each), { true: t("yes"), false: t("no") }[String(each)] ?? each])];
    return h("select", {}, shown.map(([value, text]) => h("option", { value, selected: value === String(given ?? "") }, text)));
  }
  const numeric = schema.type === "number" || schema.type === "integer";
  return h("input", {
    type: "text", inputmode: numeric ? "decimal" : null, autocomplete: "off", spellcheck: "false",
    value: given === null || given === undefined ? "" : numeric ? writtenNumber(given) : String(given), placeholder: schema.nullable ? t("by itself") : null,
  });
}

/** The value as JSON; what is no number goes as it is, so that the service says what is wrong with it. */
function valueOf(schema, input) {
  const text = input.value.trim();
  if (text === "") return undefined;
  let value = text;
  if (schema.type === "boolean") value = text === "true";
  else if (schema.type === "number" || schema.type === "integer") {
    const number = plainNumber(text);
    if (Number.isFinite(Number(number))) value = Number(number);
  }
  return value === schema.default ? undefined : value;
}

function range({ minimum, maximum, exclusiveMinimum, type }) {
  if (type !== "number" && type !== "integer") return "";
  const positive = minimum > 0 && minimum <= TINY;
  const least = positive ? 0 : (minimum ?? exclusiveMinimum);
  const beyond = positive || minimum === undefined;
  const low = least < -NO_LIMIT ? undefined : least;
  const endless = maximum === undefined || maximum > NO_LIMIT;
  if (low === undefined && endless) return "";
  if (endless) return beyond ? t("More than {low}", { low }) : t("At least {low}", { low });
  if (low === undefined) return t("At most {high}", { high: maximum });
  return beyond ? t("More than {low} to {high}", { low, high: maximum }) : t("{low} to {high}", { low, high: maximum });
}
