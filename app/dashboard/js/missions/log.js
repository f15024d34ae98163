/** What has happened in a mission, the newest first, and what could not be told yet. */

import { h, notify } from "../dom.js";
import { get } from "../state.js";
import { t } from "../texts.js";
import { moment } from "../units.js";
import { readEarlier } from "./feed.js";
import { drop, tellAgain, untoldOf } from "./outbox.js";
import { effectOf, happened } from "./wording.js";

/** What comes all the time, and changes nothing: of several in a row only the newest has a line. */
const QUIET = new Set(["telemetry", "clock"]);

/** The card of the history. */
export class Log {
  constructor() {
    this.rows = new Map();
    this.list = h("ol", { class: "log", "data-testid": "mission-log" });
    this.more = h("button", { type: "button", class: "quiet more", onclick: () => void this.#earlier() }, t("Show earlier events"));
    this.element = h("section", { class: "card", "aria-label": t("History") }, h("h3", {}, t("History")), this.list, this.more);
  }

  /** @param {object} mission as the store has it */
  draw({ id, events }) {
    if (this.events === events) return;
    this.events = events;
    const known = this.id === id ? this.rows : new Map();
    this.id = id;
    this.rows = new Map(linesOf(events).map(({ entry, others }) => {
      const key = `${entry.number} ${others}`;
      return [key, known.get(key) ?? row(entry, others)];
    }));
    const [first] = this.rows.values();
    const grown = [...this.rows.values()].slice(1).every((each, at) => each === this.list.children[at]) && this.rows.size === this.list.childElementCount + 1;
    if (grown && first) this.list.prepend(first);
    else this.list.replaceChildren(...this.rows.values());
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

/** The events that have a line, and how many others of its type each stands for. */
function linesOf(events) {
  const lines = [];
  for (const entry of events) {
    const last = lines.at(-1);
    const quiet = QUIET.has(entry.type) && !effectOf(entry);
    if (quiet && last?.quiet && last.entry.type === entry.type) last.others += 1;
    else lines.push({ entry, quiet, others: 0 });
  }
  return lines;
}

function row(entry, others) {
  const effect = effectOf(entry);
  return h("li", { class: entry.effect?.flyable === false ? "broken" : null, dataset: { number: entry.number, type: entry.type } },
    h("span", { class: "hint" }, moment(get().openMission.head.state.problem, entry.at), " "), happened(entry), others > 0 && h("span", { class: "hint" }, " ", t("and {count} before", { count: others })), effect && h("p", { class: "hint" }, effect));
}

/** The card of what was not sent; hidden where there is none of the mission. */
export function untoldCard() {
  const list = h("ul", { class: "log" });
  const element = h("section", { class: "card warning", "aria-label": t("Not sent"), "data-testid": "mission-untold", hidden: true },
    h("h3", {}, t("Not sent")), h("p", {}, t("The service has not got these. They are kept by this browser, and count once, however often they are sent.")), list);
  let drawn = null;
  const draw = () => {
    const { openMission } = get();
    const entries = openMission ? untoldOf(openMission.id) : [];
    const key = JSON.stringify(entries);
    if (key === drawn) return;
    drawn = key;
    element.hidden = !entries.length;
    list.replaceChildren(...entries.map(({ id, event, why }) => h("li", { dataset: { untold: id } }, happened({ type: event.type, event }), h("p", { class: "hint" }, why || t("It is not known whether it was sent")),
      h("div", { class: "row" }, h("button", { type: "button", onclick: () => void tellAgain(id) }, t("Send again")), h("button", { type: "button", class: "quiet danger", onclick: () => drop(id) }, t("Discard"))))));
  };
  return { element, draw };
}
