/** Sentences with named places. Each stands whole where it is used, so that it can be read, and said in another language. */

const PLACE = /\{(\w+)\}/;

/** Fill the places of a sentence with elements or texts. @param {string} sentence with places such as `{name}` @param {Record<string, any>} values @returns {any[]} children for `h` */
export function filled(sentence, values = {}) {
  return sentence.split(PLACE).map((part, at) => (at % 2 ? values[part] : part)).filter((part) => part !== "");
}

/** The same with texts alone, as a text. */
export function filledText(sentence, values = {}) {
  return filled(sentence, values).join("");
}

/** The form of a sentence that a number asks for. @param {number} count @param {{one: string, other: string}} forms */
export function counted(count, forms) {
  return count === 1 ? forms.one : forms.other;
}
