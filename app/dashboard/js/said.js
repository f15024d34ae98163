/** What the service says of errors, in the language of the page; in English where that has no translation. No page, no requests. */

import { exact, filled, ofService, tn } from "./texts.js";

/**
 * What is wrong with a field, or with a request.
 * @param {{detail: string, sentence?: string | null, values?: object | null}} error as the service answers it
 */
export function said({ detail, sentence, values }) {
  const text = ofService("errors", sentence);
  if (text === undefined) return detail;
  return filled(text, Object.fromEntries(Object.entries(values ?? {}).map(([name, value]) => [name, written(value)]))).join("");
}

function written(value) {
  if (typeof value === "number") return exact(value);
  if (Array.isArray(value)) return value.join(", ");
  return value !== null && typeof value === "object" ? said(value) : String(value);
}

/** Errors field by field. @param {object[] | null | undefined} errors as the service answers them */
export function saidErrors(errors) {
  return (errors ?? []).map((each) => ({ ...each, detail: said(each) }));
}

/**
 * Why a request is refused, or a job failed: its own sentence, else that of its first field, else what its type means with the
 * detail in English.
 * @param {object} problem problem details, or the error of a job
 * @returns {string | undefined} undefined where there is no detail
 */
export function saidOfProblem(problem) {
  const { title, detail, sentence, errors } = problem;
  if (ofService("errors", sentence) !== undefined) return said(problem);
  const [first, ...others] = errors ?? [];
  if (ofService("errors", first?.sentence) !== undefined) {
    const text = [first.parameter ?? first.pointer, said(first)].filter(Boolean).join(": ");
    return others.length ? tn(others.length, "{first} (and {count} more)", "{first} (and {count} more)", { first: text }) : text;
  }
  const meaning = ofService("errors", title);
  return meaning === undefined || detail === undefined ? detail : `${meaning} (${detail})`;
}
