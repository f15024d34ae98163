/** When the plan on screen begins, by the clock on the wall: its times are of the day then. */

import { h } from "./dom.js";
import { get, set, subscribe } from "./state.js";
import { t } from "./texts.js";
import { beginOnTheWall } from "./units.js";

/** A field for it; without a time moments count from the begin. */
export function startTime() {
  const field = h("input", { type: "datetime-local", name: "begins", onchange: () => set({ begins: field.value ? { opened: get().opened, at: field.value } : null }) });
  const label = h("label", { class: "line", id: "start-time" }, h("span", {}, t("The plan begins at")), field);
  const draw = (state) => {
    const at = beginOnTheWall(state) ?? "";
    if (field.value !== at) field.value = at;
    label.hidden = state.answerProblem?.crs !== "wgs84";
  };
  subscribe(["begins", "opened", "answerProblem"], draw);
  draw(get());
  return label;
}
