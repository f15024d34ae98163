/** Which language the page speaks: the browser's, or the one that was chosen on the page. */

import { h } from "./dom.js";
import { speak, t } from "./texts.js";

/** The languages by their codes, each with the region whose numbers it has where the browser names none. */
const LANGUAGES = { en: "en", es: "es", fr: "fr", pt: "pt-PT" };
/** The language of the texts in the modules. */
const SOURCE = "en";
const STORE = "dispatch-language";

const codeOf = (tag) => tag.split("-")[0].toLowerCase();

/** Load the language, and say what the page itself says in it. */
export async function loadLanguage() {
  const chosen = localStorage.getItem(STORE);
  const code = chosen in LANGUAGES ? chosen : (navigator.languages.map(codeOf).find((each) => each in LANGUAGES) ?? SOURCE);
  const [translations, ofService] = code === SOURCE ? [{}, {}] : await Promise.all([translationsOf(code), translationsOf(`service/${code}`)]);
  if (!translations) return;
  // The region decides how numbers are written: that of the browser, if it has this language.
  speak(navigator.languages.find((tag) => codeOf(tag) === code) ?? LANGUAGES[code], translations, ofService ?? {});
  document.documentElement.lang = code;
  translate(document.body);
}

/** @returns {Promise<object | null>} null where they cannot be read: the page stays English */
async function translationsOf(file) {
  try {
    const response = await fetch(new URL(`../languages/${file}.json`, import.meta.url));
    if (!response.ok) throw new Error(`${response.url} answered ${response.status}`);
    return await response.json();
  } catch (error) {
    console.error(error);
    return null;
  }
}

/** Attributes of the page that have texts. */
const ATTRIBUTES = ["aria-label", "title"];

/** Put the texts of the page's markup into its language, but for what is marked `translate="no"`. */
function translate(element) {
  if (element.getAttribute("translate") === "no") return;
  for (const name of ATTRIBUTES) if (element.hasAttribute(name)) element.setAttribute(name, t(element.getAttribute(name)));
  for (const node of element.childNodes) {
    if (node instanceof Element) translate(node);
    else if (node instanceof Text && node.data.trim()) node.data = node.data.replace(node.data.trim(), t(node.data.trim()));
  }
}

/** The choice of a language, by codes, as the bar has little room: the page is loaded again with it. */
export function languageChoice() {
  const nameOf = (code) => new Intl.DisplayNames(code, { type: "language" }).of(code);
  const options = Object.keys(LANGUAGES).map((code) => h("option", { value: code, lang: code, title: nameOf(code), selected: code === document.documentElement.lang }, code.toUpperCase()));
  const choose = ({ target }) => {
    localStorage.setItem(STORE, target.value);
    location.reload();
  };
  return h("select", { id: "language", "aria-label": t("Language"), title: t("Language"), translate: "no", onchange: choose }, options);
}
