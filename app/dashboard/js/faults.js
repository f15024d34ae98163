/** What the service says of a field of the problem, with the way to it. */

import { fieldTitle } from "./columns.js";
import { h } from "./dom.js";
import { BASES, ZONES } from "./kinds.js";
import { get, select, set } from "./state.js";
import { t } from "./texts.js";

const PARTS = { "/uavs": t("UAVs"), "/targets": t("Areas"), "/max_steps": t("Decision steps") };
const LISTS = ["uavs", "targets", BASES, ZONES];

/**
 * A button that leads to what a JSON pointer is about.
 * @param {string} pointer into a request
 * @param {object} problem the one of that request
 */
export function wayTo(pointer, problem) {
  const [, kind, at, ...rest] = pointer.split("/");
  const field = rest.join("/");
  const id = LISTS.includes(kind) ? problem[kind]?.[Number(at)]?.id : undefined;
  const go = () => {
    if (id !== undefined && get().problem[kind]?.some((item) => item.id === id)) select({ kind, id });
    set({ view: "problem" });
    const row = `table[data-kind="${kind}"] tr[data-id="${CSS.escape(id ?? "")}"]`;
    const cell = [field, rest[0] ?? ""].map((each) => document.querySelector(`${row} td[data-column^="${CSS.escape(each)}"]`)).find(Boolean);
    cell?.focus();
  };
  const where = id === undefined ? (PARTS[pointer] ?? pointer) : [id, rest[0] && fieldTitle(kind, rest[0], problem.crs === "wgs84")].filter(Boolean).join(", ");
  return h("button", { type: "button", class: "quiet", dataset: { pointer }, onclick: go }, where);
}
