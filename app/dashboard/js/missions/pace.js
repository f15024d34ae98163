/** The clock of a mission that follows the clock on the wall, at a chosen pace: moved on by the tab in which that was begun. */

import { ApiError, json } from "../api.js";
import { get } from "../state.js";
import { t } from "../texts.js";
import { eventId } from "./outbox.js";

const STORE = "dispatch-pace";
/** It is told at each hundredth of a unit of time, but in these limits: a state is kept for each time. */
const SHARE = 0.01;
const SOONEST_MS = 1000;
const LATEST_MS = 10_000;

let timer = null;
let told = () => {};

/** @returns {{mission: string, seconds: number, clock: number, since: number} | null} `seconds` of real time a unit takes, from when on, at which clock */
export function pace() {
  return JSON.parse(sessionStorage.getItem(STORE) ?? "null");
}

/** Say where what happens to the clock is told. @param {(trouble: string) => void} listener of what went wrong; empty: nothing */
export function onPace(listener) {
  told = listener;
}

/** Let the clock go on from where it is. @param {string} mission @param {number} seconds of real time a unit of its time takes */
export function follow(mission, seconds) {
  anchor(mission, seconds, get().openMission.head.clock);
  goOn();
}

export function halt() {
  clearTimeout(timer);
  timer = null;
  sessionStorage.removeItem(STORE);
  told("");
}

/** Go on with a clock that a reload has interrupted, as if there had been none. */
export function goOn() {
  clearTimeout(timer);
  timer = null;
  const now = pace();
  if (now) timer = setTimeout(() => void tick(), Math.min(Math.max(SHARE * 1000 * now.seconds, SOONEST_MS), LATEST_MS));
}

async function tick() {
  const { mission, seconds, clock, since } = pace();
  const at = clock + (Date.now() - since) / 1000 / seconds;
  try {
    await json(`missions/${mission}/events`, { method: "POST", body: { type: "clock", id: eventId(), at } });
    told("");
  } catch (error) {
    if (error.status === 404) return halt();
    const behind = error instanceof ApiError && error.violations.some(({ pointer }) => pointer === "/at");
    if (behind) await catchUp(mission, seconds);
    else told(t("The clock stands: {why}. It is tried again.", { why: error.message }));
  }
  if (pace()?.mission === mission) goOn();
}

/** Another dispatcher has moved the clock beyond this one: it goes on from there. */
async function catchUp(mission, seconds) {
  const { clock } = await json(`missions/${mission}`).catch(() => ({}));
  if (clock !== undefined && pace()?.mission === mission) anchor(mission, seconds, clock);
}

function anchor(mission, seconds, clock) {
  sessionStorage.setItem(STORE, JSON.stringify({ mission, seconds, clock, since: Date.now() }));
}
