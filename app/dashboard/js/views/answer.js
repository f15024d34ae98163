/** The answer: what the plan earns, every route with times and amounts, what is unmet and why. */

import { paint } from "../colours.js";
import { amounts, h, number, shown } from "../dom.js";
import { called, names, sum, waiting } from "../plan.js";
import { answeredBy, staleNote, warningsOf } from "../plan_notes.js";
import { Portions } from "../portions.js";
import { requestedBy } from "../problem.js";
import { registerView } from "../registry.js";
import { get, select, set, subscribe } from "../state.js";
import { timeline } from "../timeline.js";

const LEAST_GAP = 1e-5;
const long = { routes: null, unmet: null, timeline: null };

function figures(answer) {
  const all = [["Reward", answer.reward], ["Satisfaction", answer.satisfaction], ["Distance", answer.distance], ["λ", answer.distance_weight, 3], ["Seconds", answer.elapsed_s, 3]];
  for (const [title, value] of [["Makespan", answer.makespan], ["Changes", answer.changes]]) if (typeof value === "number") all.splice(-2, 0, [title, value]);
  return h("dl", { class: "figures", id: "figures" }, all.map(([title, value, digits]) => figure(title, value, digits)), boundFigures(answer));
}

function figure(title, value, digits) {
  return h("div", { class: "figure", dataset: { figure: title } }, h("dt", {}, title), h("dd", {}, number(value, digits)));
}

/** The proven bound and the gap to it, where they were asked for. */
function boundFigures({ bound, gap }) {
  const facts = [];
  if (typeof bound === "number") facts.push(figure("Bound", bound));
  if (typeof gap === "number") {
    const share = h("data", { value: String(gap), title: String(gap) }, gap < LEAST_GAP ? "under 0.001 %" : `${shown(100 * gap, 3)} %`);
    facts.push(h("div", { class: "figure", dataset: { figure: "Gap" } }, h("dt", {}, "Gap"), h("dd", {}, share)));
  }
  return facts;
}

function source(answer) {
  const policy = answer.source_policy;
  const how = [`${answer.algorithm}, seed ${answer.seed} `, answeredBy(answer)];
  if (!policy) return h("p", { class: "hint", id: "source" }, how);
  return h("p", { class: "hint", id: "source" }, how, ". Policy ", h("strong", { title: policy.id }, policy.name), " was transferred, distance between the tasks ", number(policy.distance));
}

/** What stands beside an arrival where the visit begins later. */
function waitHint(uav, stop, n) {
  const { time, onGround } = waiting(uav, stop, n);
  return time > 0 ? h("p", { class: "hint" }, "waits ", number(time), onGround ? " on the ground, begins " : ", begins ", number(stop.begin_time)) : null;
}

function routeRows(uav, route, nameOf) {
  return route.stops.map((stop, n) => {
    const key = paint(h("span", { class: "key", "aria-hidden": "true" }), route.uav_id);
    const first = n === 0 ? h("th", { scope: "rowgroup", rowspan: String(route.stops.length) }, h("button", { type: "button", class: "quiet", title: route.uav_id, onclick: () => select({ kind: "uavs", id: route.uav_id }) }, key, called(uav)), h("p", { class: "hint" }, number(route.distance, 3), " + ", number(route.return_distance, 3), " home")) : null;
    return h("tr", { dataset: { uavId: route.uav_id, targetId: stop.target_id, step: stop.step } }, first,
      h("td", { class: "num" }, String(n + 1)), h("td", { title: stop.target_id }, nameOf(stop.target_id)), h("td", { class: "num" }, number(stop.arrival_time), waitHint(uav, stop, n)),
      h("td", { class: "num" }, amounts(stop.delivered)));
  });
}

function routesTable(problem, answer) {
  const head = ["UAV", "#", "Area", problem.crs === "wgs84" ? "Arrives, h" : "Arrives", "Unloads"];
  const out = answer.routes.filter((route) => route.stops.length);
  if (!out.length) return h("p", { class: "card", id: "nobody-flies" }, "Nobody flies: no visit is possible, or none is worth its distance.");
  const body = h("tbody", {});
  const uavs = new Map(problem.uavs.map((uav) => [uav.id, uav]));
  const nameOf = names(problem.targets);
  long.routes = new Portions(body, out, (route) => routeRows(uavs.get(route.uav_id), route, nameOf), (button) => h("tr", {}, h("td", { colspan: "5" }, button)));
  return h("details", { open: true }, h("summary", {}, `Routes of ${out.length} of ${problem.uavs.length} UAVs`),
    h("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": "Routes" }, h("table", { id: "routes" }, h("thead", {}, h("tr", {}, head.map((title, at) => h("th", { scope: "col", class: [1, 3, 4].includes(at) ? "num" : null }, title)))), body)));
}

function unmetList(problem, answer) {
  const title = answer.unmet.length ? `Unmet needs of ${answer.unmet.length} of ${problem.targets.length} areas` : `All ${problem.targets.length} areas get all they need`;
  const needs = new Map(problem.targets.map((target) => [target.id, sum(requestedBy(target))]));
  const nameOf = names(problem.targets);
  const item = (unmet) =>
    h("li", { dataset: { targetId: unmet.target_id, code: unmet.code } },
      h("div", { class: "row spread" }, h("button", { type: "button", class: "quiet", title: unmet.target_id, onclick: () => select({ kind: "targets", id: unmet.target_id }) }, nameOf(unmet.target_id)), unmet.code && h("span", { class: "chip" }, unmet.code.replaceAll("_", " "))),
      h("p", {}, "lacks ", amounts(unmet.remaining), h("span", { class: "hint" }, ` of ${shown(needs.get(unmet.target_id))}`)),
      h("p", { class: "hint" }, unmet.reason), typeof unmet.remedy === "string" && h("p", { class: "hint" }, `Would help: ${unmet.remedy}`));
  const list = h("ul", { class: "unmet", id: "unmet" });
  long.unmet = new Portions(list, answer.unmet, item, (button) => h("li", {}, button));
  return h("details", { open: answer.unmet.length > 0 }, h("summary", {}, title), list);
}

registerView({
  id: "answer", title: "Answer", order: 30, layout: "panel",
  mount(root, { dock }) {
    const stale = staleNote("stale", "The problem was changed after this answer.");
    const draw = () => {
      const { answer, answerProblem } = get();
      if (!answer) {
        root.replaceChildren(h("p", { class: "hint" }, "No plan yet."), h("div", {}, h("button", { type: "button", class: "primary", onclick: () => set({ view: "allocate" }) }, "Allocate")));
        return dock.replaceChildren();
      }
      Object.assign(long, { routes: null, unmet: null, timeline: null });
      root.replaceChildren(stale, figures(answer), source(answer), ...[warningsOf(answer, answerProblem)].filter(Boolean), routesTable(answerProblem, answer), unmetList(answerProblem, answer));
      const { element, portions } = timeline(answerProblem, answer);
      long.timeline = portions;
      dock.replaceChildren(...(element ? [element] : []));
      markSelection();
    };
    const markSelection = () => {
      const { selection } = get();
      if (selection?.kind === "uavs") {
        long.routes?.reveal((route) => route.uav_id === selection.id);
        long.timeline?.reveal(({ uav }) => uav.id === selection.id);
      } else if (selection) {
        long.routes?.reveal((route) => route.stops.some((stop) => stop.target_id === selection.id));
        long.unmet?.reveal((unmet) => unmet.target_id === selection.id);
      }
      for (const row of [...root.querySelectorAll("#routes tbody tr"), ...dock.querySelectorAll("li[data-uav-id]")]) {
        const chosen = selection?.kind === "uavs" ? row.dataset.uavId === selection.id : selection !== null && row.dataset.targetId === selection.id;
        row.classList.toggle("chosen", chosen);
      }
      if (!clicked) root.querySelector("#routes tr.chosen")?.scrollIntoView({ block: "nearest" });
    };
    /** Do it, and keep what was clicked in the panel under the pointer. */
    let clicked = null;
    const held = (act) => {
      const was = clicked?.getBoundingClientRect().top;
      act();
      if (clicked?.isConnected) root.closest(".panel").scrollTop += clicked.getBoundingClientRect().top - was;
    };
    subscribe(["answer"], draw);
    subscribe(["selection"], () => held(markSelection));
    root.addEventListener("click", ({ target }) => { clicked = target.closest("button"); }, { capture: true });
    root.addEventListener("click", () => { clicked = null; });
    draw();
  },
});
