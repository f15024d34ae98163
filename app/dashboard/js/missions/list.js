/** The missions of the service: listed, opened, deleted, and begun with the problem and the plan on screen. */

import { json, send } from "../api.js";
import { h, notify, number } from "../dom.js";
import { Fields, showViolations } from "../fields.js";
import { get, subscribe } from "../state.js";
import { dateText, t } from "../texts.js";
import { openMission } from "./feed.js";
import { titled } from "./live_table.js";
import { eventId } from "./outbox.js";

/** Missions that others begin are seen so much later at most. */
const LOOK_AGAIN_MS = 5000;
/** Parameters of the algorithm are left to their defaults. */
const LEFT_OUT = new Set(["parameters"]);
/** Of the columns; the last one has the button that deletes. */
const TITLES = [t("Mission"), t("Clock"), t("Begun"), ""];

/** The list of missions and the form that begins one. */
export class MissionList {
  constructor() {
    this.body = h("tbody", {});
    this.says = h("p", { class: "hint", role: "status", "data-testid": "missions-status" });
    this.more = h("button", { type: "button", class: "quiet more", hidden: true, onclick: () => void this.#load(this.cursor) }, t("Show more"));
    this.form = h("div", {});
    this.element = h("div", { class: "block" }, this.form,
      h("section", { class: "card" }, h("h3", {}, t("Missions of the service")), this.says,
        h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": t("Missions") }, h("table", { "data-testid": "missions" },
          h("thead", {}, h("tr", {}, TITLES.slice(0, -1).map((title, at) => h("th", { scope: "col", class: at === 1 ? "n" : null }, title)), h("td", {}))), this.body)), this.more));
    subscribe(["fields", "problem", "answer", "answerProblem"], () => this.#drawForm());
    this.#drawForm();
  }

  /** Have it up to date while it is seen. */
  show() {
    this.hide();
    void this.#load();
    this.timer = setInterval(() => { if (!document.hidden && this.body.childElementCount <= this.first) void this.#load(); }, LOOK_AGAIN_MS);
  }

  hide() {
    clearInterval(this.timer);
  }

  async #load(cursor = null) {
    try {
      const page = await json(`missions?limit=50${cursor ? `&cursor=${encodeURIComponent(cursor)}` : ""}`);
      const rows = page.missions.map((mission) => this.#row(mission));
      if (cursor) this.body.append(...rows);
      else {
        this.first = rows.length;
        const focused = document.activeElement?.closest("tr")?.dataset.mission;
        const at = [...document.activeElement?.closest("tr")?.querySelectorAll("button") ?? []].indexOf(document.activeElement);
        this.body.replaceChildren(...rows);
        if (focused) rows.find((row) => row.dataset.mission === focused)?.querySelectorAll("button")[at]?.focus();
      }
      this.cursor = page.next_cursor;
      this.more.hidden = page.next_cursor === null;
      this.says.textContent = this.body.childElementCount ? t("The newest first.") : t("There is none yet.");
    } catch (error) {
      this.says.textContent = t("They cannot be listed: {why}", { why: error.message });
    }
  }

  #row({ id, name, clock, created_at: begun, searching }) {
    const title = name ?? id.slice(0, 8);
    const remove = async () => {
      if (!confirm(t("Delete mission {mission} with all that is kept of it?", { mission: title }))) return;
      try {
        await send(`missions/${id}`, { method: "DELETE" });
      } catch (error) {
        notify(error.message, "error");
      }
      await this.#load();
    };
    return titled(h("tr", { dataset: { mission: id } },
      h("th", { scope: "row", title: id }, h("button", { type: "button", class: "quiet", "aria-label": t("Open mission {mission}", { mission: title }), onclick: () => openMission(id) }, title), searching && h("span", { class: "chip" }, t("searching"))),
      h("td", { class: "n" }, number(clock)), h("td", { class: "wide" }, h("time", { datetime: begun }, dateText(begun))),
      h("td", {}, h("button", { type: "button", class: "quiet danger", "aria-label": t("Delete mission {mission}", { mission: title }), onclick: () => void remove() }, t("Delete")))), TITLES);
  }

  #drawForm() {
    const { fields, problem, problemName, answer, answerProblem } = get();
    if (!fields || !problem) return;
    const current = answer !== null && answerProblem === problem;
    this.plan ??= h("input", { type: "checkbox", name: "with_plan" });
    this.planLabel ??= h("span", {});
    this.plan.disabled = !current;
    this.plan.checked = current;
    this.planLabel.textContent = current ? t("The plan on screen is in force at first") : t("No plan on screen answers this problem: nobody flies at first");
    if (this.fields) {
      this.title.textContent = t("Begin a mission with {problem}", { problem: problemName });
      return;
    }
    const own = Object.fromEntries(Object.entries(fields.mission).filter(([name]) => !LEFT_OUT.has(name)));
    this.fields = new Fields(own, { pointer: "", titles: { plans: t("Better plans") } });
    const [name, ...others] = this.fields.fields;
    const rest = others.filter(({ name: field }) => field === "plans" || field === "time_limit_s");
    const further = others.filter((field) => !rest.includes(field));
    this.title = h("h3", {}, t("Begin a mission with {problem}", { problem: problemName }));
    this.elsewhere = h("ul", { class: "violations" });
    const start = h("button", { class: "primary" }, t("Begin the mission"));
    const form = h("form", { class: "card", id: "mission-form", novalidate: true }, this.title, name.element, rest.map(({ element }) => element),
      h("label", { class: "inline" }, this.plan, this.planLabel),
      h("details", {}, h("summary", {}, t("How it is planned")), h("div", { class: "fields" }, further.map(({ element }) => element))),
      this.elsewhere, h("div", { class: "row" }, start));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      void this.#begin(form, start);
    });
    this.form.replaceChildren(form);
  }

  /** The same key until a mission has begun: its answer may have been lost on the way. */
  #keyOf(body) {
    const text = JSON.stringify(body);
    if (this.tried?.text !== text) this.tried = { text, key: eventId() };
    return this.tried.key;
  }

  async #begin(form, start) {
    const { problem, answer } = get();
    start.disabled = true;
    try {
      const first = this.plan.checked && answer ? { start_plan: answer.assignment } : {};
      const body = { ...this.fields.values(), problem: { ...problem, ...first } };
      const mission = await json("missions", { method: "POST", body, headers: { "Idempotency-Key": this.#keyOf(body) } });
      this.tried = null;
      showViolations(form, []);
      this.elsewhere.replaceChildren();
      openMission(mission.id);
    } catch (error) {
      const left = showViolations(form, error.violations ?? []);
      const lines = error.violations?.length ? left.map(({ pointer, detail }) => `${pointer} ${detail}`) : [error.message];
      this.elsewhere.replaceChildren(...lines.map((line) => h("li", { class: "error" }, line)));
      form.querySelector("[aria-invalid]")?.focus();
    } finally {
      start.disabled = false;
    }
  }
}
