/**
 * The one store: what is on screen follows from it. Values are replaced, never changed in place.
 *
 * Keys are listed in README.md.
 */

const listeners = new Set();

let state = Object.freeze({
  problem: null,
  problemName: "",
  opened: "",
  begins: null,
  colours: {},
  past: [],
  future: [],
  job: null,
  answer: null,
  answerProblem: null,
  draft: null,
  openMission: null,
  untold: [],
  incumbent: null,
  violations: [],
  selection: null,
  algorithms: [],
  fields: null,
  settings: { version: "", tile_url: null, tile_attribution: "", overlay: null },
  view: "problem",
});

/** The present state, frozen. */
export function get() {
  return state;
}

/**
 * Replace some keys and tell who listens to them.
 * @param {object} patch new values by key
 */
export function set(patch) {
  const changed = Object.keys(patch).filter((key) => !Object.is(state[key], patch[key]));
  if (!changed.length) return;
  state = Object.freeze({ ...state, ...patch });
  for (const { keys, listen } of [...listeners]) {
    if (changed.some((key) => keys.includes(key))) listen(state, changed);
  }
}

/**
 * Listen to changes of some keys.
 * @param {string[]} keys
 * @param {(state: object, changed: string[]) => void} listen
 * @returns {() => void} stops it
 */
export function subscribe(keys, listen) {
  const entry = { keys, listen };
  listeners.add(entry);
  return () => listeners.delete(entry);
}

/** Select a UAV, an area or a zone, or nothing. @param {null | {kind: "uavs"|"targets"|"no_fly_zones", id: string}} selection */
export function select(selection) {
  const now = state.selection;
  if (now?.kind === selection?.kind && now?.id === selection?.id) return;
  set({ selection });
}
