/** Start of the page: the service's facts, the tabs, the keyboard, the key dialog. */

import { json, onKeyNeeded, send, useKey } from "./api.js";
import { h, notify } from "./dom.js";
import { DispatchMap } from "./map.js";
import { open, redo, undo } from "./problem.js";
import { allViews } from "./registry.js";
import { get, set, subscribe } from "./state.js";
import "./views/index.js";

const FIRST_EXAMPLE = "cyclone-idai";
const LOOK_AGAIN_MS = 10_000;
const byId = (id) => document.getElementById(id);
let map;

/** Show a view, mounting it the first time. */
function show(id) {
  const view = allViews().find((each) => each.id === id) ?? allViews()[0];
  const before = allViews().find((each) => each.root && !each.root.hidden);
  if (before === view) return;
  if (before) {
    before.root.hidden = true;
    before.dock.hidden = true;
    before.hide?.();
  }
  if (!view.root) mount(view);
  view.root.hidden = false;
  view.dock.hidden = false;
  for (const tab of byId("tabs").children) {
    const chosen = tab.dataset.view === view.id;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
  }
  const paged = view.layout === "page";
  byId("main").classList.toggle("paged", paged);
  byId("page").hidden = !paged;
  set({ view: view.id });
  layOutDock();
  if (!paged) map.resized();
  view.show?.();
}

function mount(view) {
  view.root = h("section", { id: `view-${view.id}`, role: "tabpanel", "aria-labelledby": `tab-${view.id}` });
  view.dock = h("div", { class: "dock-content", dataset: { view: view.id } });
  byId(view.layout === "page" ? "page" : "panel").append(view.root);
  byId("dock").append(view.dock);
  new MutationObserver(layOutDock).observe(view.dock, { childList: true });
  view.mount(view.root, { map, dock: view.dock });
}

/** The region below the map is there where the view has something in it. */
function layOutDock() {
  const filled = [...byId("dock").children].some((each) => !each.hidden && each.childElementCount);
  if (byId("dock").hidden === filled) {
    byId("dock").hidden = !filled;
    map.resized();
  }
}

function makeTabs() {
  const tabs = allViews().map((view) =>
    h("button", {
      type: "button", role: "tab", id: `tab-${view.id}`, dataset: { view: view.id },
      "aria-controls": `view-${view.id}`, onclick: () => set({ view: view.id }),
    }, view.title),
  );
  byId("tabs").append(...tabs);
  byId("tabs").addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = tabs[(tabs.indexOf(document.activeElement) + step + tabs.length) % tabs.length];
    next.focus();
    set({ view: next.dataset.view });
  });
}

function askForKey(why) {
  const dialog = byId("key-dialog");
  byId("key-input").value = "";
  byId("key-input").title = why ?? "";
  if (!dialog.open) dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "use" ? byId("key-input").value.trim() : null), { once: true });
  });
}

function onKeys(event) {
  const typing = event.target.closest("input, textarea, select");
  const command = event.ctrlKey || event.metaKey;
  if (command && event.key.toLowerCase() === "z" && !typing) {
    event.preventDefault();
    (event.shiftKey ? redo : undo)();
  } else if (command && event.key === "Enter") {
    set({ view: "allocate" });
    byId("allocate-form")?.requestSubmit();
  } else if (event.key === "Escape" && !typing && !document.querySelector("dialog[open]")) {
    map.stopPlacing();
    set({ selection: null });
  }
}

async function watchService() {
  const shown = byId("service");
  try {
    await send("readyz");
    shown.className = "service up";
    shown.textContent = "Ready";
  } catch (error) {
    shown.className = "service down";
    shown.textContent = error.status ? "Not ready" : "Not reachable";
  }
  setTimeout(watchService, LOOK_AGAIN_MS);
}

function titleProblem({ problem, problemName }) {
  const sizes = problem && `${problem.uavs.length} UAVs, ${problem.targets.length} areas`;
  byId("problem-title").textContent = problem ? `${problemName} · ${sizes}` : "";
}

async function start() {
  onKeyNeeded(askForKey);
  byId("key").addEventListener("click", async () => {
    const key = await askForKey();
    if (key !== null) useKey(key);
  });
  document.addEventListener("keydown", onKeys);
  subscribe(["problem", "problemName"], titleProblem);
  set({ settings: await json("dashboard/settings.json") });
  map = new DispatchMap(byId("map"));
  makeTabs();
  subscribe(["view"], ({ view }) => show(view));
  watchService();
  try {
    set({ algorithms: (await json("algorithms")).algorithms });
    open(await json(`examples/${FIRST_EXAMPLE}`), FIRST_EXAMPLE);
  } catch (error) {
    notify(error.message, "error");
    open({}, "New problem");
  }
  show(get().view);
  document.documentElement.dataset.ready = "true";
}

start();
