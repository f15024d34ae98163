/**
 * What the page says, in its language: texts, plural forms, numbers, lists and dates. The English text is the key of its
 * translations; a text without one stays English. README.md says how a text is added. No page, no requests.
 */

let texts = {};
let service = {}; // what the service says: `errors`, `fields` and `algorithms`, each by its English text
let plurals;
let lists;
let dates;
let numbers; // formats by their digits
let locale;
let decimal; // what stands between a number and its decimals

/**
 * Speak a language from now on. Modules write texts while they are loaded, so it is called before them.
 * @param {string} tag of the language and its region, as `Intl` has them, such as `pt-MZ`
 * @param {Record<string, string | Record<string, string>>} translations by English text; of a text with a count a
 *   translation for each plural form
 * @param {{errors?: Record<string, string>, fields?: Record<string, string>}} [translationsOfService] what the service says
 */
export function speak(tag, translations, translationsOfService = {}) {
  texts = translations;
  service = translationsOfService;
  locale = tag;
  plurals = new Intl.PluralRules(tag);
  lists = new Intl.ListFormat(tag, { type: "unit" });
  dates = new Intl.DateTimeFormat(tag, { dateStyle: "medium", timeStyle: "medium", hourCycle: "h23" });
  numbers = new Map();
  decimal = new Intl.NumberFormat(tag).formatToParts(0.5).find(({ type }) => type === "decimal").value;
}

speak("en", {});

/**
 * A text in the language of the page.
 * @param {string} text in English, written out in the call; values have their places in it, `{name}`
 * @param {Record<string, string | number>} [values] by name; numbers are written as the language writes them
 */
export function t(text, values = {}) {
  return filled(texts[text] ?? text, values).join("");
}

/**
 * A text with a count, in the plural form that the language has for it.
 * @param {number} count stands in the texts as `{count}`
 * @param {string} one the English text for 1
 * @param {string} other the English text for all other counts, which is the key
 * @param {Record<string, string | number>} [values]
 */
export function tn(count, one, other, values = {}) {
  const forms = texts[other];
  const text = forms ? (forms[plurals.select(count)] ?? forms.other) : count === 1 ? one : other;
  return filled(text, { count, ...values }).join("");
}

/** Like `t`, with elements among the values. @returns {any[]} children for `h` */
export function tNodes(text, values) {
  return filled(texts[text] ?? text, values);
}

/**
 * What the service says, in the language of the page. @param {"algorithms" | "errors" | "fields"} part @param {string | null | undefined} text in English
 * @returns {string | undefined} undefined where the language has no translation
 */
export function ofService(part, text) {
  return service[part]?.[text];
}

/** A text with its values, in pieces. */
export function filled(text, values) {
  const pieces = text.split(/\{(\w+)\}/).map((piece, at) => (at % 2 ? values[piece] : piece));
  return pieces.map((piece) => (typeof piece === "number" ? shown(piece) : piece)).filter((piece) => piece !== "");
}

function format(name, options) {
  if (!numbers.has(name)) numbers.set(name, new Intl.NumberFormat(locale, { useGrouping: "min2", ...options }));
  return numbers.get(name);
}

/** A number in at most so many significant digits, whole numbers in full. */
export function shown(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (Number.isInteger(value)) return minus(format("whole", { maximumFractionDigits: 0 }).format(value));
  const most = Math.max(digits, Math.floor(Math.log10(Math.abs(value))) + 1);
  const tiny = Math.abs(value) < 1e-6 ? { notation: "scientific" } : {};
  return minus(format(`${most} ${tiny.notation}`, { maximumSignificantDigits: most, ...tiny }).format(value));
}

/** A number in all its digits. */
export function exact(value) {
  const size = Math.abs(value);
  const notation = size !== 0 && (size < 1e-6 || size >= 1e15) ? "scientific" : "standard";
  return minus(format(`exact ${notation}`, { maximumSignificantDigits: 15, notation }).format(value));
}

/** A number with so many decimals. */
export function fixed(value, decimals) {
  return minus(format(`fixed ${decimals}`, { minimumFractionDigits: decimals, maximumFractionDigits: decimals }).format(value));
}

function minus(text) {
  return text.replace("-", "−");
}

/** A number as people write it into a field. */
export function writtenNumber(value) {
  return String(value).replace(".", decimal);
}

/** What was written into a field, with a decimal comma made a point where the language has a comma. */
export function plainNumber(text) {
  return decimal === "," && /^[+\-−]?\d*,\d+(e[+-]?\d+)?$/i.test(text) ? text.replace(",", ".") : text;
}

/** What stands between amounts in a line: no comma where numbers have one. */
export function betweenAmounts() {
  return decimal === "," ? "; " : ", ";
}

/** Names in a list. @param {string[]} names */
export function listed(names) {
  return lists.format(names);
}

/** A moment, with its date. @param {string | number} moment as `Date` takes it */
export function dateText(moment) {
  return dates.format(new Date(moment));
}
