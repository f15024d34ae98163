/** In the field: a mission at a moment of its plan, what has happened until then, and a new plan from there. */

import { ApiError } from "../api.js";
import { h, notify, number, shortAmounts, shown } from "../dom.js";
import { showPlan, undo } from "../history.js";
import { changes, momentOf } from "../mid_mission.js";
import { called, placeNames, rangeLeft, sum } from "../plan.js";
import { answeredBy } from "../plan_notes.js";
import { Portions } from "../portions.js";
import { freeId } from "../problem.js";
import { differenceOf } from "../outcome.js";
import { registerView } from "../registry.js";
import { allocate } from "../running.js";
import { BEGINNING, get, set, subscribe } from "../state.js";
import { allTimes, course, doingAt } from "../times.js";

const RUN_MS = 12_000; // the whole mission
const FRAME_MS = 50;
const MOST_MS = 300; // that are left out at once where the service is slow
const FEW_KINDS = 8;
/** What of a mission changes what remains. */
const FACTS = ["clock", "lost", "happened", "found", "recall"];

let parts = null;
let map = null;
let running = null; // the run that goes on by itself
let known = null; // the newest moment that the service has said, of which plan and mission
let asking = null; // the moment that is asked for
let looking = false; // whether what is on screen follows as soon as it is known
let waitingAreas = false; // whether areas are to be drawn when nobody writes in them any more
const unfolded = new Set(); // areas of many kinds whose needs are to be seen
let shownUavs = 0; // rows that were asked for
let shownAreas = 0;
let stopping = null;

registerView({ id: "field", title: "In the field", order: 50, layout: "panel", mount, show, hide });

function mount(root, context) {
  map = context.map;
  parts = {
    dock: context.dock,
    empty: h("p", { class: "muted" }, "Allocate first: the mission that goes on here is the plan that was found."),
    body: h("div", { hidden: true }),
    time: h("input", { type: "range", min: "0", step: "any", value: "0", "aria-label": "Clock", id: "field-slider" }),
    exact: h("input", { type: "number", min: "0", step: "any", value: "0", "aria-label": "Time", id: "field-time" }),
    shown: h("output", { for: "field-slider field-time", "data-testid": "field-clock" }),
    run: h("button", { type: "button", onclick: toggle }, "Let it run"),
    next: h("button", { type: "button", onclick: () => step(1) }, "Next event"),
    before: h("button", { type: "button", onclick: () => step(-1) }, "Event before"),
    uavs: h("div", { class: "scroll" }),
    areas: h("div", { class: "scroll" }),
    recall: h("input", { type: "checkbox", name: "recall", onchange: () => note({ recall: parts.recall.checked }) }),
    algorithm: h("select", { name: "algorithm" }),
    limit: h("input", { type: "number", min: "0.05", step: "any", value: "2", name: "time_limit_s" }),
    start: h("button", { type: "submit", class: "primary" }, "Allocate again from here"),
    stop: h("button", { type: "button", class: "quiet", disabled: true, onclick: () => stopping?.abort() }, "Stop"),
    status: h("p", { class: "muted", role: "status", "data-testid": "field-status" }),
    moment: h("p", { class: "muted", role: "status", "data-testid": "field-moment" }),
  };
  parts.time.addEventListener("input", () => moveTo(Number(parts.time.value)));
  parts.exact.addEventListener("change", () => moveTo(Number(parts.exact.value)));
  parts.areas.addEventListener("focusout", ({ relatedTarget }) => {
    if (!waitingAreas || parts.areas.contains(relatedTarget) || !upToDate()) return;
    waitingAreas = false;
    drawAreas(known.moment.now);
  });
  parts.body.append(
    h("section", { class: "card" },
      h("h3", {}, "Clock"),
      h("p", { class: "clock" }, parts.time, parts.exact, parts.shown),
      h("p", { class: "actions" }, parts.before, " ", parts.run, " ", parts.next),
      parts.moment),
    h("section", { class: "card" }, h("h3", {}, "UAVs"), parts.uavs,
      h("label", { class: "line" }, h("span", {}, "UAVs that fly home, or are back, may get tasks again"), parts.recall)),
    h("section", { class: "card" }, h("h3", {}, "Areas"), parts.areas,
      h("p", { class: "actions" }, h("button", { type: "button", onclick: discover }, "Add an area"))),
    h("form", { class: "card", onsubmit: (event) => { event.preventDefault(); void again(); } },
      h("h3", {}, "A new plan"),
      h("label", { class: "line" }, h("span", {}, "Algorithm"), parts.algorithm),
      h("label", { class: "line" }, h("span", {}, "Time limit, s"), parts.limit),
      h("p", { class: "actions" }, parts.start, " ", parts.stop),
      parts.status));
  root.append(h("h2", {}, "In the field"), parts.empty, parts.body);
  subscribe(["answer", "answerProblem", "mission"], (_, changed) => {
    if (changed.includes("answer")) halt();
    if (get().view === "field") begin();
  });
  subscribe(["algorithms"], algorithms);
  algorithms();
}

function algorithms() {
  const names = get().algorithms.map(({ name }) => name);
  const kept = parts.algorithm.value;
  parts.algorithm.replaceChildren(...names.map((name) => h("option", { value: name }, name)));
  parts.algorithm.value = [kept, "auto", "transfer_qmix", names[0]].find((name) => names.includes(name)) ?? "";
}

function show() {
  begin();
}

function hide() {
  halt();
  map.showPlan(null);
}

/** Show the mission of the plan on screen, if there is one. */
function begin() {
  const { answer } = get();
  parts.empty.hidden = Boolean(answer);
  parts.body.hidden = !answer;
  if (answer) draw();
  else {
    map.showPlan(null);
    parts.dock.replaceChildren();
  }
}

function plan() {
  const { answer, answerProblem: problem } = get();
  if (known?.answer !== answer || known.problem !== problem) {
    const times = allTimes(problem, answer);
    known = { answer, problem, times, course: course(problem, times), facts: null, moment: null };
  }
  return known;
}

/** Whether a plan is still on screen; there may be none by now. */
const isOnScreen = ({ answer, problem }) => get().answer === answer && get().answerProblem === problem;

/** Where the clock is: a plan may begin later than at 0. */
function clock() {
  return Math.max(plan().course.begin, get().mission.clock);
}

/** Take down what has happened in the mission until now. */
function note(patch) {
  set({ mission: { ...get().mission, ...patch } });
}

function moveTo(time) {
  const { begin, end } = plan().course;
  note({ clock: Math.min(Math.max(begin, time || 0), end) });
}

function step(way) {
  const { moments } = plan().course;
  const now = clock();
  const next = way > 0 ? moments.find((at) => at > now + 1e-9) : moments.findLast((at) => at < now - 1e-9);
  if (next !== undefined) moveTo(next);
}

function toggle() {
  if (running) halt();
  else void run();
}

/** Let the clock go, as fast as the service says what is then. */
async function run() {
  const { begin, end } = plan().course;
  if (clock() >= end) note({ clock: begin });
  const mine = (running = {});
  parts.run.textContent = "Halt";
  let took = FRAME_MS;
  while (running === mine) {
    const began = performance.now();
    moveTo(clock() + ((end - begin) * Math.min(MOST_MS, took)) / RUN_MS);
    if (!(await moment()) || clock() >= end) break;
    await new Promise((resolve) => setTimeout(resolve, Math.max(FRAME_MS - (performance.now() - began), 0)));
    took = performance.now() - began;
  }
  if (running === mine) halt();
}

function halt() {
  running = null;
  if (parts) parts.run.textContent = "Let it run";
}

function factsOf(mission) {
  return FACTS.map((name) => mission[name]);
}

/** Whether the newest moment that is known is the one on screen. */
function upToDate() {
  const facts = factsOf(get().mission);
  return plan().facts?.every((fact, at) => Object.is(fact, facts[at])) ?? false;
}

/**
 * What remains at the moment on screen; null where the service does not say. While it is asked for one moment, and
 * another is on screen by then, it is asked for that one next.
 */
async function moment() {
  while (get().answer && !upToDate()) {
    asking ??= ask().finally(() => { asking = null; });
    const { found, of, mission } = await asking;
    if (!found && isOnScreen(of) && mission === get().mission) return null;
  }
  return get().answer && known.moment;
}

/** Ask for the moment on screen; say whether it was found, and of which plan and mission. */
async function ask() {
  const of = plan();
  const { mission } = get();
  if (!running) parts.moment.textContent = "The service is asked what remains …";
  try {
    const found = await momentOf({ ...of, fields: get().fields }, { ...mission, clock: clock() });
    Object.assign(of, { facts: factsOf(mission), moment: found });
    parts.moment.textContent = "";
    return { found: true, of, mission };
  } catch (error) {
    parts.moment.replaceChildren(`What remains at ${shown(mission.clock)} is not known: ${error.message}. What you noted is kept. `, h("button", { type: "button", onclick: () => void look() }, "Ask again"));
    if (error instanceof ApiError && error.violations.length) set({ violations: error.violations });
    return { found: false, of, mission };
  }
}

/** Have the moment on screen, as soon as the service says it. */
async function look() {
  if (looking) return;
  looking = true;
  const found = await moment();
  looking = false;
  if (found && get().view === "field") drawMoment(found);
}

function draw() {
  const { problem, course: { begin, end } } = plan();
  const now = clock();
  parts.recall.checked = get().mission.recall;
  for (const input of [parts.time, parts.exact]) Object.assign(input, { min: String(begin), max: String(end) });
  parts.time.value = String(now);
  parts.exact.value = String(Number(now.toPrecision(6)));
  parts.shown.textContent = `${shown(now)} of ${shown(end)}${problem.crs === "wgs84" ? " h" : ""}`;
  const { answer, answerProblem, mission: { outcome } } = get();
  parts.dock.replaceChildren(...(outcome ? [differenceOf(outcome, answerProblem, answer)] : []));
  if (!plan().moment) for (const place of [parts.uavs, parts.areas]) place.replaceChildren();
  if (upToDate()) drawMoment(known.moment);
  else void look();
}

function drawMoment({ now, rest }) {
  drawUavs(now);
  waitingAreas = parts.areas.contains(document.activeElement);
  if (!waitingAreas) drawAreas(now);
  map.showPlan(now, rest ?? now.start_plan ?? null);
}

function drawUavs(now) {
  const { problem, times } = plan();
  const { lost } = get().mission;
  const left = new Map(now.uavs.map((uav) => [uav.id, uav]));
  const nameOf = placeNames(problem, now);
  const back = problem.objective?.return_to_base === false ? "landed" : "home";
  const body = h("tbody", {});
  parts.uavs.replaceChildren(
    h("table", { "data-testid": "field-uavs" },
      h("thead", {}, h("tr", {}, ["UAV", "Doing", "Range left", "Load", "Lost"].map((title, i) => h("th", { scope: "col", class: i === 2 || i === 3 ? "n" : null }, title)))),
      body));
  const rows = new Portions(body, problem.uavs, (uav, i) => {
        const { doing, next } = doingAt(uav, times[i], clock());
        const place = next === null ? "" : nameOf(next);
        const says = { flying: `to ${place}`, unloading: `at ${place}`, reloading: `reloads at ${place}`, home: back }[doing] ?? doing;
        const is = left.get(uav.id);
        return h("tr", { class: is ? null : "lost", "data-uav": uav.id },
          h("th", { scope: "row", title: uav.id }, called(uav)),
          h("td", {}, is ? says : "lost"),
          h("td", { class: "n" }, is ? number(rangeLeft(is)) : "–"),
          h("td", { class: "n load" }, is ? shortAmounts(is.loadlist, " · ") : "–"),
          h("td", {}, h("input", {
            type: "checkbox", "aria-label": `${uav.id} is lost`, checked: !is,
            onchange: (event) => {
              const others = lost.filter((id) => id !== uav.id);
              note({ lost: event.target.checked ? [...others, uav.id] : others });
            },
          })));
      }, (button) => h("tr", {}, h("td", { colspan: "5" }, button)));
  rows.upTo(Math.min(shownUavs, problem.uavs.length));
  body.addEventListener("click", () => { shownUavs = Math.max(shownUavs, rows.count); });
}

function drawAreas(now) {
  const { happened, found } = get().mission;
  const fresh = new Set(found.map(({ id }) => id));
  const body = h("tbody", {});
  parts.areas.replaceChildren(
    h("table", { "data-testid": "field-areas" },
      h("thead", {}, h("tr", {}, ["Area", "Level", "Still needed"].map((title) => h("th", { scope: "col" }, title)), h("th", { scope: "col" }, h("span", { class: "visually-hidden" }, "Undo")))),
      body));
  const rows = new Portions(body, [...now.targets].sort((a, b) => fresh.has(b.id) - fresh.has(a.id)), (target) =>
        h("tr", { class: fresh.has(target.id) ? "new" : target.id in happened ? "changed" : null, "data-area": target.id },
          h("th", { scope: "row", title: target.id }, called(target),
            fresh.has(target.id) && h("span", { class: "place" }, field(target, "x", "x"), field(target, "y", "y"))),
          h("td", {}, field(target, "level", "level")),
          h("td", {}, needFields(target)),
          h("td", {}, fresh.has(target.id)
            ? h("button", { type: "button", class: "quiet", onclick: () => noteArea({ found: get().mission.found.filter(({ id }) => id !== target.id) }) }, "Remove")
            : target.id in happened && h("button", { type: "button", class: "quiet", onclick: () => noteArea({ happened: without(get().mission.happened, target.id) }) }, "Undo"))),
    (button) => h("tr", {}, h("td", { colspan: "4" }, button)));
  rows.upTo(Math.min(shownAreas, now.targets.length));
  body.addEventListener("click", () => { shownAreas = Math.max(shownAreas, rows.count); });
}

/** Take something down of the areas, whose rows are then made anew. */
function noteArea(patch) {
  document.activeElement?.blur?.();
  note(patch);
}

function without(record, id) {
  const { [id]: _, ...rest } = record;
  return rest;
}

function field(target, name, what) {
  return h("input", {
    type: "number", step: "any", value: String(target[name]), "aria-label": `${what} of ${target.id}`,
    onchange: (event) => changed(target, { [name]: Number(event.target.value) }),
  });
}

/** A field for each kind needed; of many kinds folded up. */
function needFields(target) {
  const of = (k) => target.requested && h("span", { class: "hint" }, ` of ${shown(target.requested[k])}`);
  const fields = h("div", { class: "amounts" }, target.loadlist.map((amount, k) => [amountField(target, amount, k), of(k)]).flat());
  if (target.loadlist.length <= FEW_KINDS) return fields;
  const open = unfolded.has(target.id);
  return h("details", { open, ontoggle: (event) => unfolded[event.target.open ? "add" : "delete"](target.id) },
    h("summary", {}, `${shown(sum(target.loadlist))} of ${target.loadlist.filter(Boolean).length} kinds`), fields);
}

function amountField(target, amount, k) {
  return h("input", {
    type: "number", step: "any", min: "0", value: String(Number(amount.toPrecision(12))), "aria-label": `need ${k + 1} of ${target.id}`,
    onchange: (event) => {
      const loadlist = known.moment.now.targets.find(({ id }) => id === target.id).loadlist.slice();
      loadlist[k] = Number(event.target.value);
      changed(target, { loadlist });
    },
  });
}

function changed(target, fields) {
  const { found, happened } = get().mission;
  if (found.some(({ id }) => id === target.id)) noteArea({ found: found.map((each) => (each.id === target.id ? { ...each, ...fields } : each)) });
  else noteArea({ happened: { ...happened, [target.id]: { ...happened[target.id], ...fields } } });
}

/** A new area in the middle of the others; its place, level and needs are to be filled in. */
function discover() {
  if (!known?.moment) return;
  const { targets } = known.moment.now;
  const middle = (name) => targets.reduce((total, target) => total + target[name], 0) / targets.length;
  const level = Math.max(...targets.map((target) => target.level));
  const loadlist = targets[0].loadlist.map((_, k) => Math.max(...plan().problem.targets.map((target) => target.loadlist[k])));
  const area = { id: freeId("targets", targets), x: Number(middle("x").toFixed(6)), y: Number(middle("y").toFixed(6)), level, loadlist };
  noteArea({ found: [...get().mission.found, area] });
}

async function again() {
  halt();
  const { opened } = get();
  stopping = new AbortController();
  parts.start.disabled = true;
  parts.stop.disabled = false;
  parts.status.textContent = "Allocating …";
  try {
    const from = await moment();
    if (!from) throw new Error("The service does not say what remains");
    const { now } = from;
    const { problem } = known;
    const at = clock();
    if (!now.uavs.length) throw new Error("Every UAV is lost: no UAV is left to fly.");
    const given = await allocate(
      { ...now, algorithm: parts.algorithm.value, time_limit_s: Number(parts.limit.value) },
      {
        signal: stopping.signal,
        onProgress: ({ best_reward: reward }) => {
          if (reward !== null && reward !== undefined) parts.status.textContent = `Best so far: reward ${shown(reward)}.`;
        },
      });
    if (given && get().opened !== opened) notify("The plan of the mission before is ready: it is among the recent plans");
    else if (given) {
      parts.status.textContent = `A new plan from ${shown(at)} on: reward ${shown(given.reward)}. Undo goes back to the mission before.`;
      parts.status.append(...[answeredBy(given)].filter(Boolean));
      notify("A new plan is on screen", "info", { title: "Undo", act: undo });
      showPlan(now, given, { problem: now, mission: { ...BEGINNING, clock: at, outcome: changes(problem, from, given) }, selection: null });
    } else parts.status.textContent = "Stopped before there was a plan.";
  } catch (error) {
    if (error instanceof ApiError) set({ violations: error.violations });
    parts.status.textContent = error.message;
    notify(error.message, "error");
  } finally {
    parts.start.disabled = false;
    parts.stop.disabled = true;
  }
}
