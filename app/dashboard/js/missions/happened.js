/** What has happened: chosen by what is selected on the map or in a table, filled in, told to the service. */

import { h, notify } from "../dom.js";
import { labelled, showViolations } from "../fields.js";
import { BASES, ZONES } from "../kinds.js";
import { called } from "../plan.js";
import { get } from "../state.js";
import { t } from "../texts.js";
import { drawingControls } from "../zone_form.js";
import { FORMS } from "./event_forms.js";
import { tell } from "./outbox.js";
import { told } from "./wording.js";
import { ZoneShapes } from "./zone_shapes.js";

/** What can happen to an item of each list: the type of the event, and what its button says. */
const OF = {
  uavs: [["visit_done", t("Visit done")], ["reload_done", t("Reload done")], ["uav_delayed", t("Delayed")], ["uav_lost", t("Lost")]],
  targets: [["visit_done", t("Visit done")], ["level_changed", t("Urgency")], ["areas_changed", t("Need or place changed")], ["area_cancelled", t("Cancelled")]],
  [BASES]: [["reload_done", t("Reload done")], ["stock_changed", t("Stock")]],
  [ZONES]: [["zones_changed", t("Open again")]],
};
const KEYS = { uavs: "uav_id", targets: "target_id", [BASES]: "base_id", [ZONES]: "without" };

/** The card of what has happened. */
export class Happened {
  /**
   * @param {object} map
   * @param {() => {state: object, plan: object} | null} momentOf the moment on screen
   */
  constructor(map, momentOf) {
    Object.assign(this, { map, momentOf, id: null });
    this.acts = h("div", { class: "row", id: "mission-acts" });
    this.place = h("div", { class: "block" });
    this.shapes = new ZoneShapes(map, momentOf, { begun: () => this.open("zones_changed", { shapes: this.shapes }), gone: () => this.close() });
    const zone = drawingControls(map, { id: "mission-drawing", take: (polygon) => this.open("zones_changed", { polygon }) });
    const placing = (kind, type, title) => {
      const button = h("button", { type: "button", "aria-pressed": "false", dataset: { missionPlace: kind }, onclick: () => {
        if (button.getAttribute("aria-pressed") === "true") return map.stopPlacing();
        map.startPlacing(kind, () => button.setAttribute("aria-pressed", "false"), (_, at) => { map.stopPlacing(); this.open(type, at); });
        button.setAttribute("aria-pressed", "true");
        map.element.focus();
      } }, title);
      return button;
    };
    this.element = h("section", { class: "card", "aria-label": t("What has happened"), "data-testid": "mission-happened" },
      h("h3", {}, t("What has happened")), this.acts, this.place,
      h("div", { class: "row" }, placing("targets", "areas_added", t("Place a new area")), placing("uavs", "uavs_added", t("Place a new UAV")), zone.button,
        h("button", { type: "button", onclick: () => this.open("wind_changed", {}) }, t("Wind"))),
      zone.steps);
  }

  /** Bring what can happen to what is selected into sight. */
  reveal() {
    this.acts.scrollIntoView({ block: "nearest" });
  }

  /** Offer what can happen to what is selected. */
  draw() {
    const { id } = get().openMission;
    // What was filled in for one mission is not told to another.
    if (this.id !== id) this.close();
    this.id = id;
    const moment = this.momentOf();
    const { selection } = get();
    const item = selection && moment?.state.problem[selection.kind]?.find(({ id }) => id === selection.id);
    const key = `${id} ${item ? `${selection.kind} ${item.id}` : ""}`;
    if (this.acts.dataset.of === key) return;
    this.acts.dataset.of = key;
    if (!item) return this.acts.replaceChildren(h("p", { class: "hint" }, t("Select a UAV, an area, a base or a zone on the map or in a table to say what has happened to it.")));
    const possible = OF[selection.kind].filter(([type]) => type !== "reload_done" || moment.state.problem[BASES]?.length);
    this.acts.replaceChildren(h("strong", { title: item.id }, called(item)), ...possible.map(([type, title]) =>
      h("button", { type: "button", dataset: { type }, onclick: () => this.open(type, { [KEYS[selection.kind]]: item.id }) }, title)));
    if (selection.kind === ZONES) this.acts.append(h("p", { class: "hint" }, t("Drag its corners, or all of it by its middle, on the map; by keyboard with Alt and the arrows.")));
  }

  /** Open the form of something that has happened. @param {string} type of the event @param {object} given what was clicked */
  open(type, given) {
    const moment = this.momentOf();
    if (!moment) return;
    if (!get().fields) return notify(t("The service has not said yet which fields there are"), "error");
    const { title, says, parts, read, danger } = FORMS[type](given, moment);
    const ahead = moment.state.clock > get().openMission.head.clock ? moment.state.clock : undefined;
    const at = h("input", { type: "number", step: "any", min: "0", name: "at", value: ahead === undefined ? "" : String(ahead) });
    const others = h("ul", { class: "violations" });
    const send = h("button", { class: danger ? "danger" : "primary" }, t("Tell"));
    const form = h("form", { class: "block", novalidate: true, "aria-label": title, dataset: { form: type } },
      h("h4", {}, title), says && h("p", { class: "hint" }, says), parts.map(({ element }) => element),
      labelled(t("When it became known"), at, { pointer: "/at", hint: t("By the mission's clock; empty: now") }), others,
      h("div", { class: "row" }, send, h("button", { type: "button", class: "quiet", onclick: () => this.close() }, t("Cancel"))));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      void this.#tell(form, send, others, { ...read(), ...(at.value === "" ? {} : { at: Number(at.value) }) });
    });
    if (given.shapes) {
      // The hand is on the map, and goes on there.
      this.place.replaceChildren(form);
      return;
    }
    this.close();
    this.place.replaceChildren(form);
    form.scrollIntoView({ block: "nearest" });
    (form.querySelector("select, input") ?? send).focus();
  }

  close() {
    this.place.replaceChildren();
    if (this.shapes.changed.size) this.shapes.drop();
  }

  async #tell(form, send, others, event) {
    send.disabled = true;
    try {
      const answer = await tell(this.id, event);
      if (form.isConnected) this.close();
      if (answer) notify(told(answer));
      else notify(t("It could not be sent, and is kept: send it again below"), "error");
    } catch (error) {
      const left = showViolations(form, error.violations ?? []);
      const lines = error.violations?.length ? left.map(({ pointer, detail }) => `${pointer} ${detail}`) : [error.message];
      others.replaceChildren(...lines.map((line) => h("li", { class: "error" }, line)));
      form.querySelector("[aria-invalid]")?.focus();
    } finally {
      send.disabled = false;
    }
  }
}
