/** The form that adds a fleet of a type, and the one that adds UAVs like the selected one. */

import { h, notify } from "./dom.js";
import { labelled } from "./fields.js";
import { addUavs, fleetOf, uavsLike } from "./fleet.js";
import { TYPES } from "./fleet_types.js";
import { BASES } from "./kinds.js";
import { called } from "./plan.js";
import { get, subscribe } from "./state.js";
import { t, tn } from "./texts.js";

const FIRST_COUNT = 4;
const MOST_AT_ONCE = 100;
const BY_CLICK = "";
const ON_PLANE = t("On a plane, its units count as km and its time as hours.");

/** What is usual for a type, in a sentence. */
function figuresOf({ speed, voyage, load }) {
  return t("Usual for such aircraft: {speed} km/h, {voyage} km out and back, {load} kg. Put in the figures of your own.", { speed, voyage, load });
}

/** How many UAVs a field asks for; null, and said, where that is no number that can be. */
function countIn({ value }) {
  const count = Number(value);
  if (Number.isInteger(count) && count >= 1 && count <= MOST_AT_ONCE) return count;
  notify(t("How many is “{value}”: a whole number from 1 to {most} is needed", { value, most: MOST_AT_ONCE }), "error");
  return null;
}

function countField() {
  return h("input", { value: String(FIRST_COUNT), inputmode: "numeric", autocomplete: "off" });
}

/** Add a fleet: its type, how many, and where. @param {import("./map.js").DispatchMap} map */
export function fleetForm(map) {
  const type = h("select", { name: "fleet-type", onchange: () => say() }, TYPES.map(({ id, name }) => h("option", { value: id }, name)));
  const count = countField();
  const where = h("select", { name: "fleet-place" });
  const hint = h("p", { class: "hint" });
  const chosen = () => TYPES.find(({ id }) => id === type.value);
  const say = () => { hint.textContent = get().problem?.crs === "wgs84" ? figuresOf(chosen()) : `${figuresOf(chosen())} ${ON_PLANE}`; };
  const add = (number, place) => {
    addUavs(fleetOf(get().problem, chosen(), number, place));
    notify(tn(number, "{count} UAV is added", "{count} UAVs are added"));
  };
  const button = h("button", {
    type: "button", dataset: { add: "fleet" },
    onclick: () => {
      const number = countIn(count);
      if (number === null) return;
      const base = get().problem[BASES]?.find(({ id }) => id === where.value);
      if (base) return add(number, base);
      map.startPlacing("uavs", () => button.removeAttribute("aria-pressed"), (_, at) => {
        map.stopPlacing();
        add(number, at);
      });
      button.setAttribute("aria-pressed", "true");
    },
  }, t("Add the fleet"));
  const draw = () => {
    const { value } = where;
    const bases = get().problem?.[BASES] ?? [];
    where.replaceChildren(h("option", { value: BY_CLICK }, t("where I click on the map")), ...bases.map((base) => h("option", { value: base.id, selected: base.id === value }, called(base))));
    say();
  };
  subscribe(["problem"], draw);
  draw();
  return h("details", { id: "fleet" }, h("summary", {}, t("Add a fleet")),
    h("div", { class: "block" }, h("div", { class: "grid2" }, labelled(t("Type"), type), labelled(t("How many"), count)), labelled(t("Where"), where), hint, h("div", { class: "row" }, button)));
}

/** Add UAVs like one. @param {object} uav */
export function moreLike(uav) {
  const count = countField();
  const add = () => {
    const number = countIn(count);
    if (number !== null) addUavs(uavsLike(get().problem.uavs, uav, number));
  };
  return h("div", { class: "row more-like" }, labelled(t("More UAVs"), count), h("button", { type: "button", dataset: { add: "like" }, onclick: add }, t("Add as many like this")));
}
