/** No-fly zones in the panel: the steps of drawing one, and the corners of the one that is selected. */

import { h, notify } from "./dom.js";
import { ZONES } from "./kinds.js";
import { update, withoutCorner } from "./problem.js";
import { get, subscribe } from "./state.js";
import { t, tn } from "./texts.js";
import { crossings, saidOfCrossings } from "./zones.js";

/** With more corners only the ones on the map can be changed. */
const MANY = 200;

/**
 * The button that begins a zone, and what can be done while it is drawn, for those who have no keys or no pointer.
 * @param {object} map
 * @param {{id?: string, take?: (polygon: number[][]) => void}} [options] id of the steps, and what takes the zone; the problem on screen otherwise
 * @returns {{button: HTMLElement, steps: HTMLElement}}
 */
export function drawingControls(map, { id = "drawing", take } = {}) {
  let drawing = null;
  const says = h("p", { class: "hint", role: "status", id: `${id}-says` });
  const step = (title, key, act) => h("button", { type: "button", title: key, onclick: () => { if (drawing) act(); } }, title);
  const finish = step(t("Finish the zone"), t("Enter"), () => drawing.finish());
  const back = step(t("Take a corner back"), t("Backspace"), () => drawing.takeBack());
  const steps = h("div", { class: "block", hidden: true, id },
    h("p", { class: "hint" }, t("Click a corner after the other; end with the first corner again, a double click or Enter. Escape gives up. By keyboard: arrows move the map, Space sets a corner in its middle.")),
    says,
    h("div", { class: "row" }, step(t("Corner in the middle of the map"), t("Space"), () => drawing.addMiddle()), back, finish, step(t("Give up"), t("Escape"), () => drawing.giveUp())));
  const changed = (now) => {
    drawing = now;
    steps.hidden = !now;
    button.setAttribute("aria-pressed", String(Boolean(now)));
    says.textContent = now?.says ?? "";
    says.classList.toggle("error", now?.crosses ?? false);
    back.disabled = !now?.corners.length;
  };
  const button = h("button", { type: "button", "aria-pressed": "false", dataset: { draw: take ? "mission-zone" : "zone" }, onclick: () => {
    if (drawing) return drawing.giveUp();
    if (!get().fields) return notify(t("The service has not said yet what a zone is"), "error");
    map.drawZone(changed, take);
    map.element.focus();
  } }, t("Draw a zone"));
  return { button, steps };
}

/** What is wrong with the shape of a zone; empty where its sides do not cross. */
export function faultOf(zone, crs) {
  return saidOfCrossings(crossings(crs, zone.polygon), zone.polygon.length);
}

/** A line for each zone whose sides cross, there while there are any: it is said before the service is asked. */
export function crossingNotes() {
  const notes = h("ul", { class: "violations", id: "crossing-zones" });
  const draw = () => {
    const { problem } = get();
    const faults = (problem?.[ZONES] ?? []).map((zone) => [zone, faultOf(zone, problem.crs)]).filter(([, fault]) => fault);
    notes.hidden = !faults.length;
    notes.replaceChildren(...faults.map(([{ id }, fault]) => h("li", { class: "error", dataset: { zoneId: id } }, `${id}: ${fault}`)));
  };
  subscribe(["problem"], draw);
  draw();
  return notes;
}

/** The corners of a zone as fields, and what is wrong with its sides. @param {(polygon: number[][]) => void} [put] takes what it becomes; the problem on screen otherwise */
export function cornersOf(zone, { crs }, put = (polygon) => update(ZONES, zone.id, { polygon })) {
  const fault = faultOf(zone, crs);
  const names = crs === "wgs84" ? [t("longitude"), t("latitude")] : ["x", "y"];
  const number = (at, axis) => h("input", {
    type: "number", step: "any", value: String(zone.polygon[at][axis]), "aria-label": t("{axis} of corner {number}", { axis: names[axis], number: at + 1 }),
    onchange: ({ target }) => (target.value === "" ? notify(t("A corner needs two numbers"), "error") : put(zone.polygon.with(at, zone.polygon[at].with(axis, Number(target.value))))),
  });
  const between = (at) => {
    const [one, other] = [zone.polygon[at], zone.polygon[(at + 1) % zone.polygon.length]];
    return zone.polygon.toSpliced(at + 1, 0, [(one[0] + other[0]) / 2, (one[1] + other[1]) / 2]);
  };
  const both = (title) => ({ title, "aria-label": title });
  const row = (_, at) => h("tr", { dataset: { corner: at } }, h("th", { scope: "row" }, String(at + 1)), h("td", {}, number(at, 0)), h("td", {}, number(at, 1)),
    h("td", {}, h("button", { type: "button", class: "quiet", ...both(t("New corner after corner {number}", { number: at + 1 })), onclick: () => put(between(at)) }, "+"),
      h("button", { type: "button", class: "quiet", ...both(t("Remove corner {number}", { number: at + 1 })), onclick: () => withoutCorner(zone.polygon, at, put) }, "×")));
  const table = h("table", { class: "corners" }, h("thead", {}, h("tr", {}, [t("Corner"), ...names, ""].map((title) => h(title ? "th" : "td", title ? { scope: "col" } : {}, title)))), h("tbody", {}, zone.polygon.slice(0, MANY).map(row)));
  return [
    h("p", { class: "error", role: "alert", hidden: !fault, id: "zone-fault" }, fault),
    h("details", { open: true }, h("summary", {}, tn(zone.polygon.length, "{count} corner", "{count} corners")), h("div", { class: "scroll" }, table)),
  ];
}
