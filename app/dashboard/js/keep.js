/**
 * Problems with their plans in the browser's own store: what is on screen survives a reload, a crash and a closed tab.
 * Missions are the service's, and are not kept here.
 *
 * Each tab has a problem of its own. A record names the page that wrote it last: a page that finds another's name there
 * (the tab was duplicated) goes on under a new id, so that none overwrites the other's.
 */

import { present } from "./history.js";
import { get, subscribe } from "./state.js";

// The names in the browser's store stay as they were, so that what was kept there is found.
const DATABASE = "dispatch";
const VERSION = 1;
const TAB = "dispatch-mission";
const KEPT_KEYS = ["problem", "problemName", "answer", "answerProblem", "draft", "colours", "begins", "job", "past", "future"];
const STEPS_KEPT = 20;
const PROBLEMS_KEPT = 20;
const REST_MS = 200;

const page = `${Date.now()} ${Math.random()}`;
let database = null;
let id = null;
let own = false; // whether the record with this id is this page's
let changed = 0; // changes that there were, and how many of them are kept
let kept = 0;
let saving = null;
let failed = () => {};

/** A request of the store as a promise. */
function done(request) {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}

function finished(transaction) {
  return new Promise((resolve, reject) => {
    transaction.oncomplete = () => resolve();
    transaction.onerror = transaction.onabort = () => reject(transaction.error);
  });
}

function openDatabase() {
  const request = indexedDB.open(DATABASE, VERSION);
  request.onupgradeneeded = () => {
    request.result.createObjectStore("missions", { keyPath: "id" });
    request.result.createObjectStore("labels", { keyPath: "id" });
  };
  return done(request);
}

function newId() {
  own = false;
  id = `${Date.now().toString(36)}-${Math.random().toString(36).slice(2)}`;
  sessionStorage.setItem(TAB, id);
}

/** Labels of the problems there are, newest first. @returns {Promise<object[]>} `{id, savedAt, name, uavs, areas, reward}` */
export async function keptProblems() {
  if (!database) return [];
  const all = await done(database.transaction("labels").objectStore("labels").getAll());
  return all.sort((a, b) => b.savedAt - a.savedAt);
}

/** What a kept problem was, with its plan, as keys of the page's store; null where it is not there any more. */
export async function keptProblem(wanted) {
  const record = await done(database.transaction("missions").objectStore("missions").get(wanted));
  return record?.state ?? null;
}

/** Whether a kept problem is the one of this tab. */
export function isOwn(wanted) {
  return wanted === id;
}

export async function forget(wanted) {
  const transaction = database.transaction(["missions", "labels"], "readwrite");
  for (const store of ["missions", "labels"]) transaction.objectStore(store).delete(wanted);
  await finished(transaction);
}

/**
 * Find the problem of this tab, or for a new tab a copy of the newest; from then on each change is kept.
 * @param {(why: string) => void} onFailure is told once where the browser keeps nothing
 * @returns {Promise<object | null>} keys of the page's store; null where nothing was kept
 */
export async function restore(onFailure) {
  failed = (error) => {
    failed = () => {};
    onFailure(String(error?.message ?? error));
  };
  let state = null;
  try {
    database = await openDatabase();
    id = sessionStorage.getItem(TAB);
    state = id && (await keptProblem(id));
    if (!state) {
      newId();
      const [newest] = await keptProblems();
      state = newest ? await keptProblem(newest.id) : null;
    } else await claim();
  } catch (error) {
    failed(error);
  }
  return state;
}

/** Put this page's name on the record of its tab: where it was duplicated, the other one notices. */
async function claim() {
  const transaction = database.transaction("missions", "readwrite");
  const store = transaction.objectStore("missions");
  const record = await done(store.get(id));
  store.put({ ...record, page });
  await finished(transaction);
  own = true;
}

/** Keep what is on screen from now on. */
export function keepProblem() {
  let followed = null;
  subscribe(KEPT_KEYS, ({ job }, keys) => {
    const now = `${job?.id} ${job?.status}`;
    // How far a job has come, the service tells again.
    if (keys.every((key) => key === "job") && now === followed) return;
    followed = now;
    changed += 1;
    mark();
    save();
  });
  addEventListener("beforeunload", (event) => {
    const { past, answer } = get();
    if (changed === kept || !(past.length || answer)) return;
    // The browser asks; what is started here it still completes.
    void write();
    event.preventDefault();
  });
  for (const kind of ["pagehide", "visibilitychange"]) addEventListener(kind, () => { if (changed !== kept) void write(); });
}

/** Say in the document whether everything is kept. */
function mark() {
  document.documentElement.dataset.kept = String(changed === kept);
}

/** Keep it, one after the other and with a rest between. */
function save() {
  saving ??= (async () => {
    while (changed !== kept) {
      const before = kept;
      const began = performance.now();
      await write();
      if (kept === before) break; // it cannot be kept; the next change tries again
      await new Promise((resolve) => setTimeout(resolve, Math.max(REST_MS, 4 * (performance.now() - began))));
    }
    saving = null;
  })();
}

async function write() {
  const state = get();
  if (!database || !state.problem) return;
  const upTo = changed;
  try {
    if (!(await put(state))) {
      newId();
      await put(state);
    }
    kept = Math.max(kept, upTo);
    mark();
    if (!own) {
      own = true;
      await thinOut();
    }
  } catch (error) {
    failed(error);
  }
}

/** Write the record of this tab, unless it is another page's; say whether it was written. */
async function put(state) {
  const transaction = database.transaction(["missions", "labels"], "readwrite");
  const store = transaction.objectStore("missions");
  let written = true;
  const seen = store.get(id);
  seen.onsuccess = () => {
    written = !seen.result || seen.result.page === page;
    if (!written) return;
    const { problem, problemName, answer, begins, job, past, future } = state;
    const savedAt = Date.now();
    const steps = { past: past.slice(-STEPS_KEPT), future: future.slice(0, STEPS_KEPT) };
    store.put({ id, page, savedAt, state: { ...present(), begins, job, ...steps } });
    transaction.objectStore("labels").put({ id, savedAt, name: problemName, uavs: problem.uavs.length, areas: problem.targets.length, reward: answer?.reward ?? null });
  };
  await finished(transaction);
  return written;
}

/** Have only the newest ones. */
async function thinOut() {
  for (const { id: old } of (await keptProblems()).slice(PROBLEMS_KEPT)) if (old !== id) await forget(old);
}
