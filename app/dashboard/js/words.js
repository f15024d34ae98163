/** Lists of words as people write them: `medic; night flight`. What that cannot say stands as JSON. */

/** A word that can stand as it is between semicolons. */
const PLAIN = /^[^\s;["](?:[^;\p{Cc}]*[^\s;\p{Cc}])?$/u;

/** @param {string[]} words */
export function writtenWords(words) {
  return words.length && words.every((word) => PLAIN.test(word)) ? words.join("; ") : JSON.stringify(words);
}

/**
 * @param {string} text
 * @returns {string[] | null} null where it is no list of words
 */
export function wordsIn(text) {
  if (!text.trim().startsWith("[")) return text.split(";").map((word) => word.trim()).filter(Boolean);
  try {
    const words = JSON.parse(text);
    return Array.isArray(words) && words.every((word) => typeof word === "string") ? words : null;
  } catch {
    return null;
  }
}
