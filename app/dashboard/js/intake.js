/** What comes into the page: files that are chosen or dropped, and what is pasted. */

import { h, notify } from "./dom.js";
import { read, readList } from "./formats.js";
import { undo } from "./history.js";
import { askForColumns } from "./import_dialog.js";
import { withItems } from "./importing.js";
import { edit, open } from "./problem.js";
import { get, set } from "./state.js";
import { t, tn } from "./texts.js";

export const NOT_SAID = t("The service has not said yet which fields a problem has");
const TOLD = {
  targets: (count, file) => tn(count, "{count} area of {file} is here", "{count} areas of {file} are here", { file }),
  uavs: (count, file) => tn(count, "{count} UAV of {file} is here", "{count} UAVs of {file} are here", { file }),
  bases: (count, file) => tn(count, "{count} base of {file} is here", "{count} bases of {file} are here", { file }),
};

/** Open a problem, and say how what was there comes back. */
export function bring(problem, name, told = t("{problem} is open", { problem: name })) {
  sayWithUndo(told, () => open(problem, name));
}

function sayWithUndo(told, act) {
  const { past } = get();
  act();
  notify(told, "info", get().past === past ? null : { title: t("Undo"), act: undo });
}

/** Do something, and say what went wrong with it. */
export async function said(act, what = "") {
  try {
    await act();
  } catch (error) {
    notify(what + error.message, "error");
  }
}

/**
 * Take in a problem of any of the formats, or a list, whose columns are asked for.
 * @param {Uint8Array} bytes
 * @param {string} name for people
 */
export async function takeIn(bytes, name) {
  await said(async () => {
    const { problem, fields } = get();
    if (!fields) throw new Error(NOT_SAID);
    const sheet = readList(bytes);
    if (sheet) return takeList(sheet, name);
    const found = read(bytes, problem, fields);
    set({ view: "problem" });
    bring(found.problem, withoutEnding(name), [t("{problem} is open", { problem: name }), ...found.notices].join(". "));
  }, `${name}: `);
}

async function takeList(sheet, name) {
  set({ view: "problem" });
  const asked = await askForColumns(sheet, name);
  if (!asked) return;
  const { kind, items, how } = asked;
  const { problem, notices } = withItems(get().problem, get().fields, kind, items, asked);
  sayWithUndo([TOLD[kind](items.length, name), ...notices].join(". "), () => (how === "new" ? open(problem, withoutEnding(name), true) : edit(() => problem)));
}

export async function takeFile(file) {
  await takeIn(new Uint8Array(await file.arrayBuffer()), file.name);
}

/** Whether a text can be a table or a problem, and not just words. */
function isTable(text) {
  return /\d/.test(text) && (/^\s*\{/.test(text) || /\t|[;,|][^]*\n|\n[^]*[;,|]/.test(text.trim()));
}

function withoutEnding(name) {
  return name.replace(/\.[^.]+$/, "");
}

/** Files that are dropped anywhere on the page, and tables that are pasted outside of a field, are taken in. */
export function watchIntake() {
  const field = h("div", { class: "drop-here", hidden: true }, h("p", {}, t("Drop a file: a problem, or a list of places")));
  document.body.append(field);
  const hasFile = (event) => event.dataTransfer?.types.includes("Files") && !document.querySelector("dialog[open]");
  document.addEventListener("dragover", (event) => {
    if (!hasFile(event)) return;
    event.preventDefault();
    field.hidden = false;
  });
  document.addEventListener("dragleave", (event) => { field.hidden ||= event.relatedTarget === null; });
  document.addEventListener("drop", (event) => {
    field.hidden = true;
    if (!hasFile(event)) return;
    event.preventDefault();
    const [file, ...more] = event.dataTransfer.files;
    if (more.length) notify(t("One file is taken at a time: {file}", { file: file.name }));
    if (file) void takeFile(file);
  });
  document.addEventListener("paste", (event) => {
    if (document.querySelector("dialog[open]") || event.target.closest?.("input, textarea, select, [contenteditable]")) return;
    const [file] = event.clipboardData.files;
    const text = event.clipboardData.getData("text/plain");
    if (!file && !isTable(text)) return;
    event.preventDefault();
    if (file && !text) return void takeFile(file);
    void takeIn(new TextEncoder().encode(text), t("what was pasted"));
  });
}
