/** What keys do, in a dialog of its own: the button in the bar and the key `?` open it. */

import { h } from "./dom.js";
import { t } from "./texts.js";

/** Keys, and what they do: everywhere, on the map, in tables. */
const KEYS = [
  [t("Everywhere"), [
    ["Ctrl+Z", t("undo")],
    ["Ctrl+Shift+Z", t("redo")],
    [t("Ctrl+Enter"), t("look for a plan")],
    ["Ctrl+V", t("outside of a field: import the table that was copied")],
    [t("Escape"), t("stop placing, give up a zone, select nothing")],
    ["?", t("this list")],
  ]],
  [t("On the map"), [
    ["F", t("bring everything into sight")],
    [t("Enter"), t("while placing: place one in the middle; while a zone is drawn: end it")],
    [t("Space"), t("while a zone is drawn: a corner in the middle")],
    [t("Backspace"), t("while a zone is drawn: take the last corner back")],
    [t("Alt+arrows"), t("move what is selected")],
    [t("Delete"), t("delete what is selected")],
  ]],
  [t("In a table"), [
    [t("Arrows"), t("go from cell to cell")],
    [t("Enter, F2"), t("change a cell")],
    [t("Delete"), t("delete the row")],
  ]],
];

let dialog = null;

/** Show the list. */
export function showKeys() {
  dialog ??= make();
  if (!dialog.open) dialog.showModal();
}

function make() {
  const part = ([title, keys]) => [h("h3", {}, title), h("dl", { class: "keys" }, keys.flatMap(([key, does]) => [h("dt", {}, h("kbd", {}, key)), h("dd", {}, does)]))];
  const made = h("dialog", { id: "keys-dialog", "aria-labelledby": "keys-heading" }, h("form", { method: "dialog" },
    h("h2", { id: "keys-heading" }, t("Keyboard")), ...KEYS.flatMap(part), h("p", { class: "actions" }, h("button", { class: "primary" }, t("Close")))));
  document.body.append(made);
  return made;
}
