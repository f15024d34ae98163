/** The routes of a plan while they are changed by hand: visits moved, added and removed, by buttons or by dragging. */

import { paint } from "./colours.js";
import { h, notify, number } from "./dom.js";
import { saidOfBreach, withMoved, withVisit, withoutBroken, withoutVisit } from "./draft.js";
import { beginWith, changeDraft, dropDraft, judgeAgain, keepDraft } from "./drafting.js";
import { lockedCount } from "./locks.js";
import { called, placeNames } from "./plan.js";
import { Portions } from "./portions.js";
import { get, select, set } from "./state.js";
import { baseOf, placesOf } from "./stops.js";
import { shown, t, tn, tNodes } from "./texts.js";
import { moment } from "./units.js";

/** What the service says of the draft, and what can become of it. */
export function judgement(problem, answer, draft) {
  const { evaluation, refusal, trouble } = draft;
  const legal = Boolean(evaluation);
  const difference = legal ? evaluation.reward - answer.reward : 0;
  let says;
  if (trouble) says = [t("The plan is not judged yet: {why}. What you changed is kept.", { why: trouble }), " ", h("button", { type: "button", onclick: judgeAgain }, t("Ask again"))];
  else if (refusal) says = [refusal.breaches.length ? tn(refusal.breaches.length, "One visit breaks a rule, and it would not be flown:", "{count} visits break a rule, and each would not be flown:") : refusal.detail];
  else if (legal) says = tNodes("Reward {reward}, {difference} to the plan before.", { reward: number(evaluation.reward), difference: h("strong", {}, h("data", { value: String(difference) }, `${difference < 0 ? "" : "+"}${shown(difference)}`)) });
  else says = [t("The service is asked …")];
  const button = (title, act, needs = true) => h("button", { type: "button", disabled: !needs, onclick: act }, title);
  return h("section", { class: "card block", id: "draft", "data-judged": legal ? "legal" : refusal ? "refused" : trouble ? "trouble" : "asking" },
    h("h2", {}, t("Your change of the plan")), h("div", { role: "status", id: "draft-says" }, says),
    refusal && h("ul", { class: "violations", id: "breaches" }, refusal.breaches.map((breach) => h("li", { class: "error", dataset: { rule: breach.rule } }, saidOfBreach(breach, problem)))),
    refusal?.breaches.length > 0 && h("div", {}, h("button", { type: "button", onclick: () => takeOut(problem, draft) }, refusal.breaches.length === 1 ? t("Take it out") : t("Take them out"))),
    h("div", { class: "row" }, button(t("Keep this plan"), keepDraft, legal),
      button(t("Begin the next allocation with it"), () => { beginWith(draft.visits); set({ view: "allocate" }); }, legal), button(t("Leave the plan as it was"), dropDraft)));
}

/** Go on without the visits that break a rule. */
function takeOut(problem, { visits, refusal }) {
  const left = withoutBroken(problem, visits, refusal.breaches);
  if (left === visits) notify(t("No visit would have to go: the plan as a whole breaks a rule"), "error");
  else changeDraft(left);
}

/** The visits of every UAV, with what moves them. */
export class PlanEditor {
  /** @param {object} problem @param {string[][]} visits @param {{uav: number, at: number, act: string} | null} focus what was used last, where the visit is now */
  constructor(problem, visits, focus) {
    Object.assign(this, { problem, visits });
    this.nameOf = placeNames(problem);
    this.form = null;
    this.body = h("tbody", {});
    this.element = h("details", { open: true }, h("summary", {}, t("Routes, to be changed")),
      h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": t("Routes, to be changed") }, h("table", { id: "draft-routes" },
        h("thead", {}, h("tr", {}, ["#", t("Area"), t("Arrives"), ""].map((title, at) => h(title ? "th" : "td", title ? { scope: "col", class: at === 2 ? "num" : null } : {}, title)))), this.body)));
    this.portions = new Portions(this.body, problem.uavs, (uav, i) => this.#rows(uav, i), (button) => h("tr", {}, h("td", { colspan: "4" }, button)));
    this.#listenToDragging();
    this.wanted = focus;
  }

  /** Have the focus where it was, once the editor is on the page. */
  focus() {
    if (this.wanted) this.#focus(this.wanted);
    this.wanted = null;
  }

  /** Show when each visit arrives, or which rule it breaks. */
  mark({ evaluation, refusal }) {
    const arrivals = new Map((evaluation?.routes ?? []).map((route) => [route.uav_id, route.stops.map((stop) => stop.arrival_time)]));
    const broken = new Set((refusal?.breaches ?? []).map((breach) => `${breach.uav_id}\n${breach.step - 1}`));
    for (const row of this.body.querySelectorAll("tr[data-at]")) {
      const { uavId, at } = row.dataset;
      row.classList.toggle("broken", broken.has(`${uavId}\n${at}`));
      row.querySelector(".num").replaceChildren(broken.has(`${uavId}\n${at}`) ? h("span", { class: "error" }, t("not allowed")) : moment(this.problem, arrivals.get(uavId)?.[at]));
    }
  }

  reveal(test) {
    this.portions.reveal(test);
  }

  #change(visits, focus) {
    lastUsed = focus;
    changeDraft(visits);
  }

  #rows(uav, i) {
    const key = paint(h("span", { class: "key", "aria-hidden": "true" }), uav.id);
    const add = h("button", { type: "button", class: "quiet", "aria-label": t("Add a visit to {uav}", { uav: called(uav) }), dataset: { act: "add" }, onclick: ({ target }) => this.#ask(target, { uav: i, at: this.visits[i].length }, null) }, t("Add…"));
    return [
      h("tr", { class: "head", dataset: { uavId: uav.id, uav: i } }, h("th", { scope: "row", colspan: "3" }, h("button", { type: "button", class: "quiet", title: uav.id, onclick: () => select({ kind: "uavs", id: uav.id }) }, key, called(uav))), h("td", { class: "acts" }, add)),
      ...this.visits[i].map((id, at) => this.#visit(uav, i, id, at)),
    ];
  }

  #visit(uav, i, id, at) {
    const name = this.nameOf(id);
    const act = (name_, sign, title, does, possible = true) => h("button", { type: "button", class: "quiet", "aria-label": t("{act}: {area}, visit {number} of {uav}", { act: title, area: name, number: at + 1, uav: called(uav) }), title, dataset: { act: name_ }, disabled: !possible, onclick: does }, sign);
    const to = (place, what) => this.#change(withMoved(this.visits, { uav: i, at }, { uav: i, at: place }), { uav: i, at: place, act: what });
    return h("tr", { draggable: "true", dataset: { uavId: uav.id, uav: i, at, targetId: id } },
      h("td", { class: "n" }, String(at + 1)), h("td", { title: baseOf(id) ?? id }, name, at < lockedCount(uav, this.visits[i]) && [" ", h("span", { class: "chip" }, t("locked"))]), h("td", { class: "num" }, "–"),
      h("td", { class: "acts" },
        act("Earlier", "↑", t("Earlier"), () => to(at - 1, "Earlier"), at > 0), act("Later", "↓", t("Later"), () => to(at + 1, "Later"), at < this.visits[i].length - 1),
        act("Move", t("Move…"), t("Move"), ({ target }) => this.#ask(target, { uav: i, at }, id)),
        act("Remove", "×", t("Remove"), () => this.#change(withoutVisit(this.visits, { uav: i, at }), { uav: i, at: Math.min(at, this.visits[i].length - 2), act: "Remove" }))));
  }

  /** Ask below a row where a visit goes, or which area one is added of. @param {string | null} id null: to be chosen */
  #ask(button, from, id) {
    this.form?.remove();
    const { problem, visits } = this;
    const option = (value, text, selected) => h("option", { value: String(value), selected }, text);
    const area = id === null && h("select", { name: "area" }, [...placesOf(problem).keys()].map((place) => option(place, this.nameOf(place), false)));
    const uav = h("select", { name: "uav", onchange: () => limit() }, problem.uavs.map((each, i) => option(i, called(each), i === from.uav)));
    const place = h("input", { name: "place", type: "number", min: "1", step: "1", value: String(from.at + 1) });
    const limit = () => {
      const own = id !== null && Number(uav.value) === from.uav;
      const most = visits[Number(uav.value)].length + (own ? 0 : 1);
      place.max = String(most);
      if (!own) place.value = String(most);
    };
    limit();
    const close = () => { this.form.remove(); button.focus(); };
    const form = h("form", { class: "row", onkeydown: ({ key }) => { if (key === "Escape") close(); }, onsubmit: (event) => {
      event.preventDefault();
      const to = { uav: Number(uav.value), at: Number(place.value) - 1 };
      this.#change(id === null ? withVisit(visits, to, area.value) : withMoved(visits, from, to), { ...to, act: "Move" });
    } }, area && h("label", {}, t("Area"), area), h("label", {}, t("UAV"), uav), h("label", {}, t("Place"), place), h("button", {}, id === null ? t("Add") : t("Move")), h("button", { type: "button", class: "quiet", onclick: close }, t("Cancel")));
    this.form = h("tr", { class: "asked" }, h("td", { colspan: "4" }, form));
    button.closest("tr").after(this.form);
    form.querySelector("select").focus();
  }

  #focus({ uav, at, act }) {
    const { id } = this.problem.uavs[uav];
    const rows = [...this.body.querySelectorAll("tr[data-uav-id]")].filter((row) => row.dataset.uavId === id);
    const row = rows.find((each) => each.dataset.at === String(at)) ?? rows[0];
    const button = row?.querySelector(`button[data-act="${act}"]:not(:disabled)`) ?? row?.querySelector("button:not(:disabled)");
    button?.focus();
  }

  #listenToDragging() {
    let from = null;
    const rowOf = ({ target }) => target.closest?.("tr[data-uav]");
    const placeOf = (row) => ({ uav: Number(row.dataset.uav), at: Number(row.dataset.at ?? 0) });
    this.body.addEventListener("dragstart", (event) => {
      const row = rowOf(event);
      if (row?.dataset.at === undefined) return;
      from = placeOf(row);
      event.dataTransfer.effectAllowed = "move";
      event.dataTransfer.setData("text/plain", row.dataset.targetId);
    });
    this.body.addEventListener("dragover", (event) => {
      const row = rowOf(event);
      for (const other of this.body.querySelectorAll(".drop")) other.classList.toggle("drop", other === row);
      if (!from || !row) return;
      event.preventDefault();
      row.classList.add("drop");
    });
    this.body.addEventListener("drop", (event) => {
      const row = rowOf(event);
      if (!from || !row) return;
      event.preventDefault();
      const to = placeOf(row);
      if (to.uav !== from.uav || to.at !== from.at) this.#change(withMoved(this.visits, from, to), { ...to, act: "Move" });
    });
    this.body.addEventListener("dragend", () => { from = null; for (const row of this.body.querySelectorAll(".drop")) row.classList.remove("drop"); });
  }
}

/** What was used last: the editor that shows the change has the focus there. */
let lastUsed = null;

/** An editor of the draft in the store, with the focus where it was. */
export function editorOf({ answerProblem, draft } = get()) {
  const focus = lastUsed;
  lastUsed = null;
  return new PlanEditor(answerProblem, draft.visits, focus);
}
