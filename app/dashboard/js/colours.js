/** Colours of UAVs: each keeps its own while the list changes, and over a reload. */

import { get, set, subscribe } from "./state.js";

/** Custom properties `--uav-0` to `--uav-7` of the style sheet: eight colours that differ for every kind of colour vision, in both themes. */
const COLOURS = 8;
/** Each of them as a line, dashed, dotted, and dashed and dotted. */
const PATTERNS = 4;
const TOLD_APART = COLOURS * PATTERNS;

/** The name of the custom property of the n-th of several things. */
export function colourName(n) {
  return `--uav-${n % COLOURS}`;
}

/** The pattern of its line, from 0. */
export function pattern(n) {
  return Math.floor(n / COLOURS) % PATTERNS;
}

/** Give an element the colour of a UAV. @param {HTMLElement | SVGElement} element @param {string} id @param {number} [place] of one that is not on screen */
export function paint(element, id, place = 0) {
  const n = get().colours[id] ?? place;
  element.style.setProperty("--own", `var(${colourName(n)})`);
  for (let each = 1; each < PATTERNS; each += 1) element.classList.toggle(`pattern-${each}`, pattern(n) === each);
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
