/** The page: the service's facts, the tabs, the keyboard, the key dialog. */

import { keepAddress, read } from "./address.js";
import { resume, running } from "./allocation.js";
import { hasKey, json, onKeyNeeded, send, useKey } from "./api.js";
import { keepColours } from "./colours.js";
import { h, notify } from "./dom.js";
import { judgeDrafts } from "./drafting.js";
import { redo, undo } from "./history.js";
import { watchIntake } from "./intake.js";
import { keepProblem, restore } from "./keep.js";
import { showKeys } from "./keys_help.js";
import { languageChoice } from "./language.js";
import { DispatchMap } from "./map.js";
import { lastOpen, openMission } from "./missions/feed.js";
import { keepUntold } from "./missions/outbox.js";
import { goOn } from "./missions/pace.js";
import { open } from "./problem.js";
import { openPlan } from "./recent.js";
import { allViews } from "./registry.js";
import { fieldsOf } from "./schema.js";
import { sizeText } from "./sizes.js";
import { get, set, subscribe } from "./state.js";
import { t } from "./texts.js";
import { planNow } from "./views/allocate.js";
import "./views/index.js";

const FIRST_EXAMPLE = "cyclone-idai";
const LOOK_AGAIN_MS = 10_000;
const byId = (id) => document.getElementById(id);
let map; // made once the page has been loaded
let missing = false; // what the service offers is not known, as it could not be asked

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
  byId("dock").hidden = !filled;
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

/** Ask for a key. @param {string | null} why the one before was refused; null: there was none */
function askForKey(why = null) {
  const dialog = byId("key-dialog");
  const input = byId("key-input");
  input.value = "";
  byId("key-why").textContent = why ? `${why[0].toUpperCase()}${why.slice(1)}.` : "";
  byId("key-why").hidden = !why;
  byId("key-forget").hidden = !hasKey();
  dialog.returnValue = "";
  if (!dialog.open) dialog.showModal();
  input.focus();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      const given = dialog.returnValue === "use" ? input.value.trim() : null;
      input.value = "";
      resolve(given);
    }, { once: true });
  });
}

function makeKeyDialog() {
  const dialog = byId("key-dialog");
  onKeyNeeded(askForKey);
  byId("key-cancel").addEventListener("click", () => dialog.close());
  byId("key-forget").addEventListener("click", () => {
    useKey(null);
    dialog.close();
    notify(t("The key is forgotten."));
  });
  byId("key").addEventListener("click", async () => {
    const key = await askForKey();
    if (!key) return;
    useKey(key);
    if (!get().algorithms.length) await load();
  });
}

function onKeys(event) {
  if (document.querySelector("dialog[open]")) return;
  const typing = event.target.closest("input, textarea, select");
  const command = event.ctrlKey || event.metaKey;
  if (command && event.key.toLowerCase() === "z" && !typing) {
    event.preventDefault();
    if (map?.drawing && !event.shiftKey) map.drawing.takeBack();
    else (event.shiftKey ? redo : undo)();
  } else if (command && event.key === "Enter") {
    planNow();
  } else if (event.key === "Escape" && !typing) {
    map?.stopPlacing();
    set({ selection: null });
  } else if (event.key === "?" && !typing && !event.target.closest("table[role=grid]")) {
    event.preventDefault();
    showKeys();
  }
}

let looking = null;

/** Say whether the service is there, again and again while the page is seen. */
async function watchService() {
  clearTimeout(looking);
  looking = null;
  if (document.hidden) return;
  const tell = (state, text) => {
    const shown = byId("service");
    shown.className = `service ${state}`;
    if (shown.textContent !== text) shown.textContent = text;
  };
  try {
    await send("readyz");
    tell("up", t("Ready"));
  } catch (error) {
    tell("down", error.status ? t("Not ready") : t("Not reachable"));
  }
  if (missing) await load();
  clearTimeout(looking);
  looking = setTimeout(watchService, LOOK_AGAIN_MS);
}

function titleProblem({ problem, problemName }) {
  const sizes = problem && sizeText(problem.uavs.length, problem.targets.length);
  byId("problem-title").textContent = problem ? `${problemName} · ${sizes}` : "";
}

/** Learn what the service offers, and open an example where nothing was made yet. */
async function load() {
  try {
    if (!get().fields) set({ fields: fieldsOf(await json("openapi.json")) });
    const { algorithms } = await json("algorithms");
    missing = false;
    set({ algorithms });
    const { problem, past } = get();
    if (!problem || !(past.length || problem.uavs.length || problem.targets.length)) {
      open(await json(`examples/${FIRST_EXAMPLE}`), FIRST_EXAMPLE);
    }
  } catch (error) {
    missing = error.status === 0 || error.status >= 500;
    if (!missing) notify(error.message, "error");
  }
}

/** Bring back what this tab showed last; a job that was under way is followed on. */
async function comeBack() {
  const kept = await restore((why) => notify(t("This browser keeps nothing ({why}): export what you need before you leave.", { why }), "error"));
  keepProblem();
  if (!kept) return;
  set(kept);
  if (running(kept.job)) kept.job.id ? void resume(kept.job.id, kept.problem, kept.job.algorithm) : set({ job: null });
}

async function openFromAddress(job) {
  try {
    await openPlan(job);
  } catch (error) {
    notify(error.message, "error");
  }
}

async function start() {
  const asked = read(location.hash);
  makeKeyDialog();
  document.addEventListener("keydown", onKeys);
  byId("keys").addEventListener("click", showKeys);
  subscribe(["problem", "problemName"], titleProblem);
  keepColours();
  judgeDrafts();
  keepUntold();
  watchIntake();
  set({ settings: await json("dashboard/settings.json").catch(() => get().settings) });
  map = new DispatchMap(byId("map"));
  makeTabs();
  byId("key").before(languageChoice());
  if (asked) set({ view: asked.view });
  await comeBack();
  await load();
  if (!get().problem) open({}, t("New problem"));
  const mission = asked?.view === "missions" ? asked.mission : lastOpen();
  if (mission) openMission(mission);
  goOn();
  subscribe(["view"], ({ view }) => show(view));
  document.addEventListener("visibilitychange", watchService);
  void watchService();
  show(get().view);
  keepAddress((job) => void openFromAddress(job), openMission);
  if (asked?.job && asked.job !== get().answer?.job_id) await openFromAddress(asked.job);
  document.documentElement.dataset.ready = "true";
}

start();
