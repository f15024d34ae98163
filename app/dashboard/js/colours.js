/** Colours of UAVs: each keeps its own while the list changes, and over a reload. */

import { get, set, subscribe } from "./state.js";

const GOLDEN_ANGLE = 137.508;
const FIRST_HUES = [250, 30, 150, 330, 85, 200, 295, 55];
/** Hues, each plain and in another shade, each of them as a line and dashed. */
const TOLD_APART = 4 * FIRST_HUES.length;

/** Hue of the n-th of several things, far from its neighbours'. */
export function hue(n) {
  return n < TOLD_APART ? FIRST_HUES[n % FIRST_HUES.length] : (n * GOLDEN_ANGLE) % 360;
}

/** Give an element the colour of a UAV. @param {HTMLElement | SVGElement} element @param {string} id @param {number} [place] of one that is not on screen */
export function paint(element, id, place = 0) {
  const n = get().colours[id] ?? place;
  const round = n < TOLD_APART ? Math.floor(n / FIRST_HUES.length) : 0;
  element.style.setProperty("--hue", hue(n));
  element.style.setProperty("--shade", round % 2);
  element.classList.toggle("dashed", round > 1);
  return element;
}

/**
 * Numbers of colours by UAV id.
 * @param {Record<string, number>} before those there are
 * @param {{id: string}[]} uavs
 * @returns {Record<string, number>} the same object where nothing is new; the colour of a UAV that is gone is kept for it
 */
export function coloured(before, uavs) {
  const taken = new Set();
  const without = [];
  for (const { id } of uavs) {
    const n = before[id];
    if (n === undefined || taken.has(n)) without.push(id);
    else taken.add(n);
  }
  if (!without.length) return before;
  const after = { ...before };
  const kept = new Set(Object.values(before));
  let [fresh, free] = [0, 0];
  for (const id of without) {
    while (kept.has(fresh)) fresh += 1;
    while (taken.has(free)) free += 1;
    after[id] = fresh < TOLD_APART ? fresh : free;
    taken.add(after[id]);
    kept.add(after[id]);
  }
  return after;
}

/** Keep the store's colours. */
export function keepColours() {
  subscribe(["problem", "openMission"], ({ problem, openMission, colours }) => {
    const own = coloured(colours, problem?.uavs ?? []);
    set({ colours: coloured(own, openMission?.head?.state.problem.uavs ?? []) });
  });
}
