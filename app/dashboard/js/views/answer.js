/** The answer: what the plan earns, every route with times and amounts, what is unmet and why. */

import { stocksLeft } from "../bases.js";
import { h, number } from "../dom.js";
import { assignmentOf, visitsOf } from "../draft.js";
import { beginDraft, beginWith } from "../drafting.js";
import { figures } from "../figures.js";
import { Finder } from "../finder.js";
import { editorOf, judgement } from "../plan_editor.js";
import { answeredBy, nobodyFlies, staleNote, warningsOf } from "../plan_notes.js";
import { registerView } from "../registry.js";
import { routesTable } from "../routes_table.js";
import { get, set, subscribe } from "../state.js";
import { startTime } from "../start_time.js";
import { t, tNodes } from "../texts.js";
import { timeline } from "../timeline.js";
import { unmetList } from "../unmet_list.js";

const long = { routes: null, unmet: null, timeline: null };

function source(answer) {
  if (!answer.algorithm) return h("p", { class: "hint", id: "source" }, t("A plan that was changed by hand"));
  const policy = answer.source_policy;
  const how = [t("{algorithm}, seed {seed}", { algorithm: answer.algorithm, seed: String(answer.seed) }), " ", answeredBy(answer)];
  if (!policy) return h("p", { class: "hint", id: "source" }, how);
  return h("p", { class: "hint", id: "source" }, how, h("span", { class: "amount" },
    tNodes("Policy {policy} was transferred, distance between the tasks {distance}.", { policy: h("strong", { title: policy.id }, policy.name), distance: number(policy.distance) })));
}

/** Do something to the plan on screen, in a line of its own below the figures. */
function acts() {
  const button = (title, does) => h("button", { type: "button", onclick: does }, title);
  return h("div", { class: "row", id: "plan-acts" }, button(t("Change this plan"), beginDraft), button(t("Begin the next allocation with it"), () => {
    const { answer, answerProblem } = get();
    beginWith(visitsOf(answerProblem, answer));
    set({ view: "allocate" });
  }));
}

let shownMap = null;

/** While the plan is changed, the map of this view has it as it is changed. */
function drawMap() {
  const { answerProblem, draft, view } = get();
  if (draft && view === "answer") {
    shownMap.showPlan(answerProblem, draft.evaluation ?? assignmentOf(answerProblem, draft.visits));
    drawMap.given = true;
  } else if (drawMap.given) {
    drawMap.given = false;
    shownMap.showPlan(null);
  }
}

registerView({
  id: "answer", title: t("Answer"), order: 30, layout: "panel",
  mount(root, { map, dock }) {
    shownMap = map;
    const stale = staleNote("stale", t("The problem was changed after this answer."));
    const begins = startTime();
    const finder = new Finder(() => {
      for (const part of [drawRoutes, drawRest]) part(get());
      markSelection();
    });
    const locks = h("p", { class: "hint", role: "status", id: "locks-say" });
    const [head, routes, rest] = [h("div", { class: "block" }), h("div", { class: "block" }), h("div", { class: "block" })];
    let markLocks = () => {};
    let editor = null;
    const drawHead = ({ answer, answerProblem, draft }) => {
      if (draft) head.replaceChildren(stale, judgement(answerProblem, answer, draft));
      else head.replaceChildren(stale, ...[nobodyFlies(answer, answerProblem)].filter(Boolean), ...figures(answerProblem, answer), begins, source(answer), ...[warningsOf(answer, answerProblem)].filter(Boolean), acts());
    };
    const drawRoutes = ({ answer, answerProblem, draft }) => {
      long.routes = null;
      markLocks = () => {};
      if (draft) {
        if (editor?.visits !== draft.visits) editor = editorOf();
        editor.mark(draft);
        if (!editor.element.isConnected) routes.replaceChildren(editor.element);
        editor.focus();
        return;
      }
      editor = null;
      finder.fit(answerProblem);
      const table = routesTable(answerProblem, answer, finder.choose(answerProblem, answer).routes, (text) => { locks.textContent = text; });
      long.routes = table.portions;
      markLocks = table.markLocks;
      // The field that is typed into stays where it is, and so keeps the focus.
      if (finder.element.parentElement !== routes) routes.replaceChildren(finder.element);
      for (const other of [...routes.children].slice(1)) other.remove();
      routes.append(table.element, locks);
    };
    const drawRest = ({ answer, answerProblem, draft }) => {
      // Until the service has said something of the draft, what it said last stays.
      if (draft && !draft.evaluation && !draft.refusal) return;
      Object.assign(long, { unmet: null, timeline: null });
      if (draft?.refusal) {
        rest.replaceChildren(h("p", { class: "hint" }, t("What is unmet is known as soon as no rule is broken.")));
        return dock.replaceChildren();
      }
      const plan = draft?.evaluation ?? answer;
      const chosen = draft ? plan : finder.choose(answerProblem, plan);
      const unmet = unmetList(answerProblem, plan, chosen.unmet, Boolean(draft));
      long.unmet = unmet.portions;
      rest.replaceChildren(...[unmet.element, stocksLeft(answerProblem, plan)].filter(Boolean));
      const { element, portions } = timeline(answerProblem, plan, chosen.routes);
      long.timeline = portions;
      dock.replaceChildren(...(element ? [element] : []));
    };
    const draw = () => {
      const state = get();
      if (!state.answer) {
        editor = null;
        root.replaceChildren(h("p", { class: "hint" }, t("No plan yet.")), h("div", {}, h("button", { type: "button", class: "primary", onclick: () => set({ view: "allocate" }) }, t("Allocate"))));
        return dock.replaceChildren();
      }
      if (!head.isConnected) root.replaceChildren(head, routes, rest);
      for (const part of [drawHead, drawRoutes, drawRest]) part(state);
      markSelection();
    };
    const markSelection = () => {
      const { selection } = get();
      if (selection?.kind === "uavs") {
        long.routes?.reveal((route) => route.uav_id === selection.id);
        editor?.reveal((uav) => uav.id === selection.id);
        long.timeline?.reveal(({ uav }) => uav.id === selection.id);
      } else if (selection) {
        long.routes?.reveal((route) => route.stops.some((stop) => stop.target_id === selection.id));
        long.unmet?.reveal((unmet) => unmet.target_id === selection.id);
      }
      for (const row of [...root.querySelectorAll(":is(#routes, #draft-routes) tbody tr"), ...dock.querySelectorAll("li[data-uav-id]")]) {
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
    subscribe(["answer", "draft", "begins"], (_, changed) => {
      if (changed.includes("answer")) locks.textContent = "";
      draw();
      drawMap();
    });
    subscribe(["problem"], () => markLocks());
    subscribe(["selection"], () => held(markSelection));
    root.addEventListener("click", ({ target }) => { clicked = target.closest("button"); }, { capture: true });
    root.addEventListener("click", () => { clicked = null; });
    draw();
  },
  show: drawMap,
  hide: drawMap,
});
