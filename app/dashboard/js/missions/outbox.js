/**
 * Events on their way to the service. Each has an id of its own before it is sent, and is in the browser's store until the
 * service has it: what could not be sent is shown, also after a reload and in other tabs, and is sent again under the
 * same id, so that it never counts twice.
 */

import { ApiError, json, mayPass } from "../api.js";
import { get, set } from "../state.js";

const STORE = "dispatch-untold";
/** What is on its way for so long belonged to a page that is gone. */
const UNDER_WAY_MS = 30_000;
/** Without a key, or with one that is refused, another one may do. */
const NEEDS_KEY = new Set([401, 403]);

/** An id that no other event has. */
export function eventId() {
  return `page-${[...crypto.getRandomValues(new Uint8Array(12))].map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
}

/**
 * Tell the service of an event.
 * @param {string} mission its id
 * @param {object} event without `id`
 * @returns {Promise<object | null>} the service's answer; null where it could not be sent, and is kept
 * @throws {ApiError} where the service refuses it; then it is not kept
 */
export function tell(mission, event) {
  const entry = { id: eventId(), mission, event, why: "", since: Date.now() };
  save([...read(), entry]);
  return send(entry, true);
}

/** Send what was not sent once more; a refusal is noted. */
export async function tellAgain(id) {
  const entry = read().find((each) => each.id === id);
  if (!entry) return null;
  save(read().map((each) => (each.id === id ? { ...each, why: "", since: Date.now() } : each)));
  return send(entry, false);
}

/** Give up what was not sent. */
export function drop(id) {
  save(read().filter((each) => each.id !== id));
}

/** Have the store follow what other tabs could not send, and what is left from before. */
export function keepUntold() {
  addEventListener("storage", ({ key }) => { if (key === STORE) show(); });
  show();
}

async function send({ id, mission, event }, throws) {
  try {
    const answer = await json(`missions/${mission}/events`, { method: "POST", body: { ...event, id } });
    drop(id);
    return answer;
  } catch (error) {
    const refused = error instanceof ApiError && !mayPass(error) && !NEEDS_KEY.has(error.status) && error.status < 500;
    if (refused && throws) {
      drop(id);
      throw error;
    }
    note(id, error.message);
    return null;
  }
}

function note(id, why) {
  save(read().map((each) => (each.id === id ? { ...each, why } : each)));
}

/** @returns {{id: string, mission: string, event: object, why: string, since: number}[]} `why` is empty while it is on its way */
function read() {
  return JSON.parse(localStorage.getItem(STORE) ?? "[]");
}

function save(entries) {
  localStorage.setItem(STORE, JSON.stringify(entries));
  show();
}

function show() {
  set({ untold: read() });
}

/** What of a mission was not sent: all but what is on its way. */
export function untoldOf(mission) {
  const now = Date.now();
  return get().untold.filter((each) => each.mission === mission && (each.why || now - each.since > UNDER_WAY_MS));
}
