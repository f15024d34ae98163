/** Allocate: one button to plan, algorithm, parameters and limits as the service describes them for who wants them; the reward climbing live. */

import { allocate, cancel, running, statusName } from "../allocation.js";
import { beginningNotes } from "../beginning.js";
import { drawCurves } from "../curve.js";
import { h, number } from "../dom.js";
import { wayTo } from "../faults.js";
import { Fields, labelled, showViolations } from "../fields.js";
import { registerView } from "../registry.js";
import { get, set, subscribe } from "../state.js";
import { ofService, t } from "../texts.js";
import { crossingNotes } from "../zone_form.js";

/** The field that asks to keep what is learned: only some algorithms learn. */
const KEEPING = "keep_checkpoint";
const PREFERRED = ["auto", "transfer_qmix"];
const OWN_FIELDS = new Set(["algorithm", "parameters", KEEPING]);
const FIRST_LIMIT_S = 5;
/** Where this browser keeps whether what is advanced is open: who works with it finds it open again. */
const ADVANCED = "dispatch-advanced";
const REDRAW_MS = 150;
const SAY_EVERY_MS = 6000;

/** What a search will do, in a sentence. @param {string} algorithm @param {number | string | undefined} limit seconds */
function searchSaid(algorithm, limit) {
  if (limit === undefined) return t("The search ({algorithm}) has no time limit: it ends by itself, or when you stop it.", { algorithm });
  return t("The search ({algorithm}) takes at most {limit} s, and can be stopped before: the best plan so far is kept.", { algorithm, limit });
}

/** The form; returns it with a function that reads it. */
function makeForm() {
  const { algorithms, fields } = get();
  const names = algorithms.map(({ name }) => name);
  const compared = new Set(algorithms.filter(({ comparison }) => comparison).map(({ name }) => name));
  const first = PREFERRED.find((name) => names.includes(name)) ?? names[0];
  const choice = h("select", { name: "algorithm", onchange: () => choose() }, names.map((name) => h("option", { value: name, selected: name === first }, compared.has(name) ? t("{algorithm} (for comparison)", { algorithm: name }) : name)));
  const summary = h("p", { class: "hint" });
  const search = h("p", { class: "hint", id: "search" });
  const say = () => { search.textContent = searchSaid(choice.value, limits.values().time_limit_s); };
  const place = h("div", {});
  const rest = Object.fromEntries(Object.entries(fields.request).filter(([name]) => !OWN_FIELDS.has(name)));
  const limits = new Fields(rest, { pointer: "", values: { time_limit_s: FIRST_LIMIT_S }, onchange: () => say() });
  const kept = fields.request[KEEPING] ? { [KEEPING]: fields.request[KEEPING] } : {};
  const keeping = new Fields(kept, { pointer: "", titles: { [KEEPING]: t("Keep what is learned") } });
  const learns = () => fields.learners.includes(choice.value);
  let parameters;
  const choose = () => {
    const algorithm = algorithms.find(({ name }) => name === choice.value);
    summary.textContent = ofService("algorithms", algorithm.summary) ?? algorithm.summary;
    parameters = new Fields(algorithm.parameters.properties ?? {}, { pointer: "/parameters", defs: algorithm.parameters.$defs });
    place.replaceChildren(parameters.element);
    keeping.element.hidden = !learns();
    say();
  };
  choose();
  const elsewhere = h("ul", { class: "violations", id: "violations" });
  const start = h("button", { class: "primary", title: "Ctrl+Enter", id: "start" }, t("Plan"));
  const stop = h("button", { type: "button", class: "danger", id: "cancel", onclick: cancel }, t("Stop, keep the best"));
  const keepOpen = () => localStorage.setItem(ADVANCED, String(!advanced.open));
  const advanced = h("details", { id: "advanced", open: localStorage.getItem(ADVANCED) === "true" }, h("summary", { onclick: keepOpen }, t("Advanced")),
    h("div", { class: "block" }, labelled(t("Algorithm"), choice, { pointer: "/algorithm" }), summary, limits.element, keeping.element, h("details", { id: "parameters" }, h("summary", {}, t("Parameters")), place)));
  const form = h("form", { id: "allocate-form", class: "block", novalidate: true },
    h("div", { class: "row" }, start, stop), search, beginningNotes(), crossingNotes(), elsewhere, advanced);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const { job, problem } = get();
    const none = ["uavs", "targets"].filter((kind) => !problem[kind].length);
    if (none.length) set({ violations: none.map((kind) => ({ pointer: `/${kind}`, detail: t("none yet: place at least one on the map, or import a list") })) });
    else if (!running(job)) allocate({ algorithm: choice.value, parameters: parameters.values(), ...limits.values(), ...(learns() ? keeping.values() : {}) });
  });
  const enable = () => {
    start.disabled = running(get().job);
    stop.hidden = !start.disabled;
  };
  const refuse = () => {
    const { violations } = get();
    const others = showViolations(form, violations);
    for (const closed of form.querySelectorAll("details:has([aria-invalid])")) closed.open = true;
    elsewhere.replaceChildren(...others.map(({ pointer, detail }) => h("li", { class: "error" }, wayTo(pointer, get().problem), ` ${detail}`)));
    form.querySelector("[aria-invalid]")?.focus();
  };
  subscribe(["job"], enable);
  subscribe(["violations"], refuse);
  enable();
  return form;
}

/** How far the job is. */
function makeProgress() {
  const bar = h("progress", { max: "1", "aria-label": t("Progress") });
  const facts = h("dl", { class: "figures" });
  const wrong = h("p", { class: "error", id: "job-error", role: "alert" });
  const said = h("p", { class: "visually-hidden", role: "status", id: "reward-said" });
  const root = h("div", { class: "card", id: "progress" }, h("div", { class: "row spread" }, h("h2", {}, t("Job")), h("span", { class: "chip", id: "job-status" })), bar, facts, wrong, said);
  let saidAt = -Infinity;
  let saidOf = "";
  // Someone who listens to the page hears of the start, the end, and now and then of the reward.
  const say = (job) => {
    const of = `${job.status} ${job.best_reward == null}`;
    if (of === saidOf && performance.now() - saidAt < SAY_EVERY_MS) return;
    saidAt = performance.now();
    saidOf = of;
    const text = job.best_reward == null ? t("The job is {status}.", { status: statusName(job.status) }) : t("The job is {status}, best reward {reward}.", { status: statusName(job.status), reward: job.best_reward });
    if (said.textContent !== text) said.textContent = text;
  };
  const figure = (title, value) => h("div", { class: "figure" }, h("dt", {}, title), h("dd", {}, value));
  const draw = ({ job }) => {
    root.hidden = job === null;
    if (!job) return;
    root.querySelector("#job-status").textContent = statusName(job.status);
    bar.value = job.fraction ?? 0;
    wrong.textContent = job.error ?? "";
    wrong.hidden = !job.error;
    say(job);
    facts.replaceChildren(figure(t("Best reward"), number(job.best_reward)), figure(t("Epoch"), number(job.epoch)), figure(t("Seconds"), job.trace.length ? number(job.trace.at(-1).t, 3) : "–"));
  };
  subscribe(["job"], draw);
  draw(get());
  return root;
}

/** The reward against time, in the region below the map. */
function makeChart(dock) {
  const chart = h("div", { class: "chart", id: "reward-chart" });
  let waiting = null;
  const draw = () => {
    waiting = null;
    const { job } = get();
    if (!job || (job.status === "failed" && !job.trace.length)) return dock.replaceChildren();
    if (!dock.childElementCount) dock.append(chart);
    const points = job.trace.filter(({ reward }) => reward !== null).map(({ t, reward }) => [t, reward]);
    drawCurves(chart, [{ name: job.algorithm ?? "", points }], { x: t("seconds"), height: 170, label: t("Reward against time, now {reward}", { reward: job.best_reward ?? "–" }) });
  };
  const later = () => { waiting ??= setTimeout(draw, REDRAW_MS); };
  subscribe(["job"], later);
  return draw;
}

let redraw = () => {};
let form = null;
let wanted = false; // to allocate as soon as there is a form

/** Go to this view and allocate with what its form says. */
export function planNow() {
  set({ view: "allocate" });
  if (form) form.requestSubmit();
  else wanted = true;
}

registerView({
  id: "allocate", title: t("Allocate"), order: 20, layout: "panel",
  mount(root, { dock }) {
    redraw = makeChart(dock);
    const waiting = h("p", { class: "hint" }, t("The service has not said yet what it offers."));
    root.append(waiting);
    const fill = () => {
      if (!get().algorithms.length || !waiting.isConnected) return;
      form = makeForm();
      waiting.replaceWith(form, makeProgress());
      if (wanted) form.requestSubmit();
      wanted = false;
    };
    subscribe(["algorithms"], fill);
    fill();
  },
  show: () => redraw(),
});

// A plan that was found, not one that comes back with its problem.
subscribe(["answer"], ({ answer, view }, changed) => {
  if (answer && view === "allocate" && !changed.includes("problem")) set({ view: "answer" });
});
