/** Missions: the list of them, and the one that is open, which several dispatchers may follow at once. */

import { json } from "../api.js";
import { h, notify } from "../dom.js";
import { change, undo } from "../history.js";
import { ClockCard } from "../missions/clock_card.js";
import { asSeen } from "../missions/doing.js";
import { openMission, readAgain } from "../missions/feed.js";
import { Happened } from "../missions/happened.js";
import { MissionList } from "../missions/list.js";
import { Log, untoldCard } from "../missions/log.js";
import { Proposals } from "../missions/proposals.js";
import { missionTables } from "../missions/tables.js";
import { newOpening, normalised } from "../problem.js";
import { registerView } from "../registry.js";
import { get, select, set, subscribe } from "../state.js";
import { t } from "../texts.js";
import { timeline } from "../timeline.js";

let parts = null;
let map = null;
let looked = null; // another moment than the mission's clock: {at, number, state, plan}
let wanted = null; // the moment that is asked for, or was asked for last: {id, at}
let asking = false;
let trouble = "";
let drawn = null; // what the tables show
let mapped = null; // what the map shows

registerView({ id: "missions", title: t("Missions"), order: 50, layout: "panel", mount, show, hide });

function mount(root, context) {
  map = context.map;
  const list = new MissionList();
  const untold = untoldCard();
  parts = {
    dock: context.dock, list, untold,
    clock: new ClockCard(look), proposals: new Proposals(() => draw()), happened: new Happened(map, moment), log: new Log(),
    title: h("h2", { tabindex: "-1" }), tables: missionTables(tellOf, () => parts.happened.reveal()), body: h("div", { class: "block", hidden: true }),
    link: h("span", { class: "chip", role: "status", "data-testid": "mission-link" }),
    says: h("p", { class: "error", role: "alert", hidden: true, "data-testid": "mission-trouble" }),
    cards: h("div", { class: "block" }),
  };
  parts.cards.append(parts.clock.element, untold.element, parts.proposals.element, parts.happened.element, parts.tables.element, parts.log.element);
  parts.body.append(
    h("div", { class: "row spread" }, parts.title, parts.link),
    h("div", { class: "row" }, h("button", { type: "button", onclick: () => openMission(null) }, t("All missions")), h("button", { type: "button", onclick: takeOver }, t("Open what remains as a problem"))),
    parts.says, parts.cards);
  root.append(h("div", {}, h("h2", {}, t("Missions")), list.element), parts.body);
  parts.overview = root.firstElementChild;
  subscribe(["openMission"], ({ openMission: now }) => {
    if (wanted && wanted.id !== now?.id) forget();
    // The moment that is looked at may be another one after each event.
    else if (looked && now.head.state_number !== looked.of) void ask();
    if (get().view === "missions") draw();
  });
  subscribe(["untold"], () => { if (get().view === "missions") parts.untold.draw(); });
  subscribe(["selection", "view"], ({ view }) => { if (view === "missions" && get().openMission?.head) parts.happened.draw(); markSelection(); });
}

function show() {
  drawn = null;
  mapped = null;
  draw();
}

function hide() {
  parts.list.hide();
  map.showPlan(null);
  const { selection, problem } = get();
  // The other views know the items of their problem only.
  if (selection && !problem[selection.kind]?.some(({ id }) => id === selection.id)) select(null);
}

/** The moment on screen: what is looked at, or the mission as it stands. */
function moment() {
  const { openMission: now } = get();
  if (!now?.head) return null;
  return looked?.state ? looked : { state: now.head.state, plan: now.plan };
}

/** Look at another moment. @param {number | null} at null: the mission's clock */
function look(at) {
  if (at === null) {
    forget();
    return draw();
  }
  wanted = { id: get().openMission.id, at };
  void ask();
}

function forget() {
  looked = null;
  wanted = null;
  trouble = "";
}

/** Ask for the moment that is wanted; while one is asked for, and another is wanted by then, that one is asked for next. */
async function ask() {
  if (asking) return;
  asking = true;
  for (let last = null; wanted && wanted !== last; ) {
    last = wanted;
    const of = get().openMission.head.state_number;
    try {
      const found = await json(`missions/${last.id}/state?at=${last.at}`);
      if (wanted?.id !== last.id) continue;
      looked = { ...found, of };
      trouble = "";
    } catch (error) {
      if (wanted?.id === last.id) trouble = t("The state at {time} is not known: {why}.", { time: last.at, why: error.message });
    }
  }
  asking = false;
  if (get().view === "missions" && get().openMission?.head) draw();
}

function draw() {
  const { openMission: now } = get();
  const open = now !== null;
  if (parts.overview.hidden !== open || parts.body.hidden === open) {
    parts.overview.hidden = open;
    parts.body.hidden = !open;
    if (open) parts.list.hide();
  }
  if (!open) {
    drawn = null;
    mapped = null;
    parts.list.show();
    parts.dock.replaceChildren();
    return map.showPlan(null);
  }
  parts.says.textContent = now.trouble ?? "";
  parts.says.hidden = !now.trouble;
  parts.link.textContent = now.connected ? t("live") : t("not connected");
  parts.link.className = `chip ${now.connected ? "good" : "warn"}`;
  parts.cards.hidden = !now.head;
  parts.title.textContent = now.head ? t("Mission {name}", { name: now.head.name ?? now.id.slice(0, 8) }) : t("Mission");
  if (!now.head || !now.plan) return;
  drawMission(now);
}

function drawMission(now) {
  const on = moment();
  parts.clock.draw(now, on.state.clock, saysOf(now, on));
  parts.untold.draw();
  parts.proposals.draw(now);
  parts.happened.draw();
  parts.log.draw(now);
  const key = [on.state, on.plan, now.positions];
  if (drawn?.every((each, at) => each === key[at])) return drawMap(now, on);
  drawn = key;
  parts.tables.draw(on, now.positions);
  const { element } = timeline(on.state.problem, on.plan);
  parts.dock.replaceChildren(...(element ? [element] : []));
  markSelection();
  drawMap(now, on);
}

function tellOf(type, given) {
  parts.happened.open(type, given);
}

function saysOf({ head }, on) {
  if (trouble) return trouble;
  const { clock } = on.state;
  if (clock === head.clock) return "";
  const times = { time: clock, clock: head.clock };
  return clock > head.clock ? t("This is planned for {time}; the mission is at {clock}.", times) : t("This is how it was at {time}; the mission is at {clock}.", times);
}

/** UAVs where they are, what they are on their way to, and the plan: the one in force, or the proposal that is looked at. */
function drawMap(now, on) {
  const proposal = now.proposals.find(({ number }) => number === parts.proposals.seen);
  const plan = proposal ?? on.plan;
  const positions = looked?.state ? null : now.positions;
  if (mapped && mapped.state === on.state && mapped.plan === plan && mapped.positions === positions) return;
  mapped = { state: on.state, plan, positions };
  const problem = normalised(asSeen(on.state, positions ?? {}, now.head.state_number));
  map.showPlan(problem, plan, { underWay: !proposal });
  parts.happened.shapes.draw();
}

function markSelection() {
  const { selection } = get();
  for (const row of parts?.tables.element.querySelectorAll("tr[data-uav], tr[data-area]") ?? []) {
    const { uav, area, stop } = row.dataset;
    row.classList.toggle("chosen", selection?.kind === "uavs" ? uav === selection.id : selection?.kind === "targets" && (area === selection.id || stop === selection.id));
  }
}

/** Bring the problem that remains on the page, where it can be allocated, changed by hand and taken away. */
async function takeOver() {
  const on = moment();
  if (!on) return;
  const { name, id } = get().openMission.head;
  let matrices;
  try {
    // States have no matrices: those of the mission's first problem stay as they are.
    if (on.state.problem.uavs.some(({ location }) => location != null)) ({ matrices } = (await json(`missions/${id}/replay`)).problem);
  } catch (error) {
    return notify(error.message, "error");
  }
  change({ problem: normalised({ ...on.state.problem, matrices }), problemName: t("{mission} at {time}", { mission: name ?? id.slice(0, 8), time: on.state.clock }), opened: newOpening(), answer: null, answerProblem: null, incumbent: null, selection: null });
  set({ view: "problem" });
  notify(t("What remains of the mission is open as a problem; the mission goes on by itself"), "info", { title: t("Undo"), act: undo });
}

addEventListener("online", () => { if (get().openMission) void readAgain(); });
