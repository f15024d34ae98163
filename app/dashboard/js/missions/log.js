/** What has happened in a mission, the newest first, and what could not be told yet. */

import { h, notify, number } from "../dom.js";
import { get } from "../state.js";
import { readEarlier } from "./feed.js";
import { drop, tellAgain, untoldOf } from "./outbox.js";
import { effectOf, happened } from "./wording.js";

/** The card of the history. */
export class Log {
  constructor() {
    this.known = new Map();
    this.list = h("ol", { class: "log", reversed: true, "data-testid": "mission-log" });
    this.more = h("button", { type: "button", class: "quiet more", onclick: () => void this.#earlier() }, "Show earlier events");
    this.element = h("section", { class: "card", "aria-label": "History" }, h("h3", {}, "History"), this.list, this.more);
  }

  /** @param {object} mission as the store has it */
  draw({ id, events }) {
    if (this.id !== id) {
      this.id = id;
      this.known.clear();
    }
    const rows = events.map((entry) => {
      if (!this.known.has(entry.number)) this.known.set(entry.number, row(entry));
      return this.known.get(entry.number);
    });
    if (rows[0] !== this.list.firstElementChild || rows.length !== this.list.childElementCount) this.list.replaceChildren(...rows);
    this.more.hidden = !events.length || events.at(-1).number === 1;
  }

  async #earlier() {
    try {
      await readEarlier();
    } catch (error) {
      notify(error.message, "error");
    }
  }
}

function row(entry) {
  const effect = effectOf(entry);
  return h("li", { value: String(entry.number), class: entry.effect?.flyable === false ? "broken" : null, dataset: { number: entry.number, type: entry.type } },
    h("span", { class: "hint" }, number(entry.at), " "), happened(entry), effect && h("p", { class: "hint" }, effect));
}

/** The card of what was not sent; hidden where there is none of the mission. */
export function untoldCard() {
  const list = h("ul", { class: "log" });
  const element = h("section", { class: "card warning", "aria-label": "Not sent", "data-testid": "mission-untold", hidden: true },
    h("h3", {}, "Not sent"), h("p", {}, "The service has not got these. They are kept by this browser, and count once, however often they are sent."), list);
  let drawn = null;
  const draw = () => {
    const { openMission } = get();
    const entries = openMission ? untoldOf(openMission.id) : [];
    const key = JSON.stringify(entries);
    if (key === drawn) return;
    drawn = key;
    element.hidden = !entries.length;
    list.replaceChildren(...entries.map(({ id, event, why }) => h("li", { dataset: { untold: id } }, happened({ type: event.type, event }), h("p", { class: "hint" }, why || "It is not known whether it was sent"),
      h("div", { class: "row" }, h("button", { type: "button", onclick: () => void tellAgain(id) }, "Send again"), h("button", { type: "button", class: "quiet danger", onclick: () => drop(id) }, "Discard")))));
  };
  return { element, draw };
}
