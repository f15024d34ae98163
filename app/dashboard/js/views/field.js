/** In the field: a mission at a moment of its plan, what has happened until then, and a new plan from there. */

import { ApiError } from "../api.js";
import { h, notify, number, shortAmounts, shown } from "../dom.js";
import { showPlan, undo } from "../history.js";
import { changes, missionEnd, moments, problemAt, remainder, uavAt, withNeeds } from "../mid_mission.js";
import { called, names, sum } from "../plan.js";
import { answeredBy } from "../plan_notes.js";
import { Portions } from "../portions.js";
import { freeId } from "../problem.js";
import { registerView } from "../registry.js";
import { allocate } from "../running.js";
import { BEGINNING, get, set, subscribe } from "../state.js";

const FRAMES = 240; // the whole mission in about 12 s
const FRAME_MS = 50;
const MOST_FRAMES = 3; // left out at once where drawing is slow
const FEW_KINDS = 8;

let parts = null;
let map = null;
let ticking = null;
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
  };
  parts.time.addEventListener("input", () => moveTo(Number(parts.time.value)));
  parts.exact.addEventListener("change", () => moveTo(Number(parts.exact.value)));
  parts.body.append(
    h("section", { class: "card" },
      h("h3", {}, "Clock"),
      h("p", { class: "clock" }, parts.time, parts.exact, parts.shown),
      h("p", { class: "actions" }, parts.before, " ", parts.run, " ", parts.next)),
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
  const { answer, answerProblem } = get();
  return { answer, problem: answerProblem };
}

/** Take down what has happened in the mission until now. */
function note(patch) {
  set({ mission: { ...get().mission, ...patch } });
}

function moveTo(time) {
  const { answer, problem } = plan();
  note({ clock: Math.min(Math.max(0, time || 0), missionEnd(problem, answer)) });
}

function step(way) {
  const { answer, problem } = plan();
  const { clock } = get().mission;
  const all = moments(problem, answer);
  const next = way > 0 ? all.find((at) => at > clock + 1e-9) : all.findLast((at) => at < clock - 1e-9);
  if (next !== undefined) moveTo(next);
}

function toggle() {
  if (ticking) halt();
  else {
    const { answer, problem } = plan();
    const end = missionEnd(problem, answer);
    if (get().mission.clock >= end) note({ clock: 0 });
    parts.run.textContent = "Halt";
    const tick = () => {
      const began = performance.now();
      moveTo(get().mission.clock + (end / FRAMES) * Math.min(MOST_FRAMES, Math.max(1, took / FRAME_MS)));
      took = performance.now() - began;
      if (get().mission.clock >= end) halt();
      else ticking = setTimeout(tick, Math.max(FRAME_MS - took, took));
    };
    let took = 0;
    ticking = setTimeout(tick, FRAME_MS);
  }
}

function halt() {
  clearTimeout(ticking);
  ticking = null;
  if (parts) parts.run.textContent = "Let it run";
}

/** The problem at the moment, with what has happened. */
function present() {
  const { answer, problem } = plan();
  const { clock, lost, happened, found, recall } = get().mission;
  const at = problemAt(problem, answer, clock, { lost: new Set(lost), recall });
  const told = (target) => {
    const { loadlist = target.loadlist, ...fields } = happened[target.id] ?? {};
    return { ...(loadlist === target.loadlist ? target : withNeeds(target, loadlist)), ...fields };
  };
  return { ...at, targets: [...at.targets.map(told), ...found] };
}

function draw() {
  const { answer, problem } = plan();
  const { clock, recall } = get().mission;
  const end = missionEnd(problem, answer);
  parts.recall.checked = recall;
  parts.time.max = String(end);
  parts.time.value = String(clock);
  parts.exact.max = String(end);
  parts.exact.value = String(Number(clock.toPrecision(6)));
  parts.shown.textContent = `${shown(clock)} of ${shown(end)}${problem.crs === "wgs84" ? " h" : ""}`;
  const now = present();
  drawUavs(now);
  if (!parts.areas.contains(document.activeElement)) drawAreas(now);
  drawMap(now);
  drawOutcome();
}

function drawMap(now) {
  const { answer, problem } = plan();
  const { clock, lost } = get().mission;
  const rest = remainder(problem, answer, clock, new Set(lost));
  const coming = new Map();
  for (const { stops } of rest)
    for (const { target_id: id, delivered } of stops)
      coming.set(id, delivered.map((amount, k) => amount + (coming.get(id)?.[k] ?? 0)));
  const unmet = now.targets
    .map(({ id, loadlist }) => ({ target_id: id, remaining: loadlist.map((need, k) => Math.max(0, need - (coming.get(id)?.[k] ?? 0))) }))
    .filter(({ remaining }) => remaining.some((amount) => amount > 1e-9));
  map.showPlan(now, { routes: rest, unmet });
}

function drawUavs(now) {
  const { answer, problem } = plan();
  const { clock, lost } = get().mission;
  const left = new Map(now.uavs.map((uav) => [uav.id, uav]));
  const nameOf = names([...problem.targets, ...now.targets]);
  const body = h("tbody", {});
  parts.uavs.replaceChildren(
    h("table", { "data-testid": "field-uavs" },
      h("thead", {}, h("tr", {}, ["UAV", "Doing", "Range left", "Load", "Lost"].map((title, i) => h("th", { scope: "col", class: i === 2 || i === 3 ? "n" : null }, title)))),
      body));
  const rows = new Portions(body, problem.uavs, (uav, i) => {
        const is = uavAt(problem, answer, i, clock);
        const doing = { flying: `to ${nameOf(is.next)}`, unloading: `at ${nameOf(is.next)}` }[is.doing] ?? is.doing;
        const gone = lost.includes(uav.id);
        return h("tr", { class: gone ? "lost" : null, "data-uav": uav.id },
          h("th", { scope: "row", title: uav.id }, called(uav)),
          h("td", {}, gone ? "lost" : doing),
          h("td", { class: "n" }, gone ? "–" : number(uav.voyage - is.flown)),
          h("td", { class: "n load" }, gone ? "–" : shortAmounts(left.get(uav.id).loadlist, " · ")),
          h("td", {}, h("input", {
            type: "checkbox", "aria-label": `${uav.id} is lost`, checked: gone,
            onchange: (event) => {
              const others = get().mission.lost.filter((id) => id !== uav.id);
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
      const loadlist = present().targets.find(({ id }) => id === target.id).loadlist.slice();
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
  const { targets } = present();
  const middle = (name) => targets.reduce((total, target) => total + target[name], 0) / targets.length;
  const level = Math.max(...targets.map((target) => target.level));
  const loadlist = targets[0].loadlist.map((_, k) => Math.max(...plan().problem.targets.map((target) => target.loadlist[k])));
  const area = { id: freeId("targets", targets), x: Number(middle("x").toFixed(6)), y: Number(middle("y").toFixed(6)), level, loadlist };
  noteArea({ found: [...get().mission.found, area] });
}

async function again() {
  halt();
  const { answer, problem } = plan();
  const now = present();
  if (!now.uavs.length) {
    notify("Every UAV is lost: nobody is left to fly.", "error");
    return;
  }
  const { clock, lost } = get().mission;
  const { opened } = get();
  const rest = remainder(problem, answer, clock, new Set(lost));
  stopping = new AbortController();
  parts.start.disabled = true;
  parts.stop.disabled = false;
  parts.status.textContent = "Allocating …";
  try {
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
      parts.status.textContent = `A new plan from ${shown(clock)} on: reward ${shown(given.reward)}. Undo goes back to the mission before.`;
      parts.status.append(...[answeredBy(given)].filter(Boolean));
      notify("A new plan is on screen", "info", { title: "Undo", act: undo });
      showPlan(now, given, { problem: now, mission: { ...BEGINNING, outcome: changes(now, rest, given) }, selection: null });
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

/** What the newest plan changed, as long as it is the mission on screen. */
function drawOutcome() {
  const { answer, answerProblem, mission: { outcome: difference } } = get();
  if (!difference) {
    parts.dock.replaceChildren();
    return;
  }
  const [uavOf, areaOf] = [names(answerProblem.uavs), names(answerProblem.targets)];
  const list = (ids) => (ids.length ? ids.map(areaOf).join(" → ") : "home");
  const percent = (share) => (share === null ? "–" : `${Math.round(100 * share)} %`);
  const gained = answer.reward - difference.kept.reward;
  const moved = difference.areas.filter(({ before, after }) => Math.abs((before ?? 0) - (after ?? 0)) > 1e-6);
  parts.dock.replaceChildren(
    h("section", { class: "difference", "data-testid": "field-changes" },
      h("h3", {}, "What the new plan changes"),
      h("p", {}, "Going on with the old plan would earn ", number(difference.kept.reward), ", the new one earns ",
        number(answer.reward), " (", h("strong", {}, `${gained >= 0 ? "+" : ""}${shown(gained)}`), ")."),
      h("div", { class: "two" },
        h("table", {},
          h("thead", {}, h("tr", {}, ["UAV", "Before", "Now", ""].map((title) => h("th", { scope: "col" }, title)))),
          h("tbody", {}, difference.routes.filter((route) => route.kind === "lost" || route.before.length || route.after.length).map((route) =>
            h("tr", { "data-uav": route.uav_id, class: route.kind },
              h("th", { scope: "row", title: route.uav_id }, uavOf(route.uav_id)), h("td", {}, list(route.before)),
              h("td", {}, route.kind === "lost" ? "–" : list(route.after)), h("td", {}, h("span", { class: "chip" }, route.kind)))))),
        h("table", {},
          h("thead", {}, h("tr", {}, ["Area", "Met before", "Met now"].map((title, i) => h("th", { scope: "col", class: i ? "n" : null }, title)))),
          h("tbody", {}, moved.length
            ? moved.map((area) => h("tr", { "data-area": area.target_id },
              h("th", { scope: "row", title: area.target_id }, areaOf(area.target_id)), h("td", { class: "n" }, percent(area.before)), h("td", { class: "n" }, percent(area.after))))
            : h("tr", {}, h("td", { colspan: "3" }, "Every area gets what it would have got.")))))));
}
