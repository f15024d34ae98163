/**
 * The mission that is open: what the service says of it, kept up to date by its stream. The page keeps nothing of its own:
 * what is on screen is what the service said last.
 */

import { ApiError, json, listen } from "../api.js";
import { get, set } from "../state.js";
import { t } from "../texts.js";

/** Of this tab, so that a reload in another view opens the mission again. */
const OPEN = "dispatch-open-mission";
/** Events that are read when a mission is opened; earlier ones are read when they are asked for. */
const READ_AT_ONCE = 100;
/** So many are kept while others come; those before can be read again. */
const MOST_KEPT = 500;
/** A search that has found nothing better tells no event: while there is one, the mission is asked so often. */
const LOOK_AGAIN_MS = 1000;
const TRIES = 5;

let feed = null;

/** The mission that this tab had open last. @returns {string | null} */
export function lastOpen() {
  return sessionStorage.getItem(OPEN);
}

/** Open a mission, in place of the one that is open. @param {string | null} id null: have none open */
export function openMission(id) {
  if ((get().openMission?.id ?? null) === id) return;
  feed?.end();
  feed = id === null ? null : new Feed(id);
  if (id === null) sessionStorage.removeItem(OPEN);
  else sessionStorage.setItem(OPEN, id);
  set({ openMission: id === null ? null : { id, connected: false, trouble: null, head: null, plan: null, proposals: [], events: [], positions: {} } });
  void feed?.begin();
}

/** Read the mission that is open again, as soon as what is being read is there. */
export function readAgain() {
  return feed?.read();
}

/** Read earlier events than those that are known. */
export async function readEarlier() {
  const { id, events } = get().openMission;
  const first = events.at(-1)?.number ?? 1;
  const after = Math.max(0, first - 1 - READ_AT_ONCE);
  const { events: earlier } = await json(`missions/${id}/events?after=${after}&limit=${first - 1 - after}`);
  if (get().openMission?.id === id) patch({ events: [...get().openMission.events, ...earlier.reverse()] });
}

function patch(changed) {
  set({ openMission: { ...get().openMission, ...changed } });
}

/** One mission, as long as it is open. */
class Feed {
  constructor(id) {
    this.id = id;
    this.ending = new AbortController();
    this.reading = null;
    this.again = false;
    this.timer = null;
  }

  end() {
    this.ending.abort();
    clearTimeout(this.timer);
  }

  get #ended() {
    return this.ending.signal.aborted;
  }

  /** Read the mission, then listen to it until it is closed or deleted. */
  async begin() {
    await this.read();
    const last = get().openMission?.events[0]?.number ?? 0;
    try {
      await listen(`missions/${this.id}/stream`, (event) => this.#hear(event), {
        last: String(last), signal: this.ending.signal,
        opened: () => { if (this.#ended) return; patch({ connected: true }); void this.read(); },
        lost: () => { if (!this.#ended) patch({ connected: false }); },
      });
    } catch (error) {
      this.#fail(error);
    }
  }

  /** Read what the mission is now; what is asked while it is being read is read once more after that. */
  read() {
    if (this.reading) this.again = true;
    this.reading ??= this.#read().finally(() => { this.reading = null; });
    return this.reading;
  }

  async #read() {
    do {
      this.again = false;
      clearTimeout(this.timer);
      try {
        await this.#readOnce();
      } catch (error) {
        return this.#fail(error);
      }
    } while (this.again && !this.#ended);
    if (this.#ended) return;
    if (get().openMission.head.searching) this.timer = setTimeout(() => void this.read(), LOOK_AGAIN_MS);
  }

  async #readOnce() {
    const path = `missions/${this.id}`;
    const { signal } = this.ending;
    const { head: before, events } = get().openMission;
    const head = await json(path, { signal });
    const changed = { head, trouble: null };
    // Another event may come between two answers: both have to be of the same one.
    for (let tries = 0; before?.state_number !== changed.head.state_number && tries < TRIES; tries += 1) {
      changed.plan = await json(`${path}/plan`, { signal });
      if (changed.plan.number === changed.head.state_number) break;
      changed.head = await json(path, { signal });
    }
    ({ proposals: changed.proposals } = await json(`${path}/proposals`, { signal }));
    if (!events.length) {
      const after = Math.max(0, head.last_number - READ_AT_ONCE);
      changed.events = (await json(`${path}/events?after=${after}&limit=${READ_AT_ONCE}`, { signal })).events.reverse();
    }
    if (!this.#ended) patch({ ...changed, positions: newest(get().openMission.positions, changed.head.positions) });
  }

  #hear({ data }) {
    if (!data || this.#ended) return;
    const event = JSON.parse(data);
    const { events, positions } = get().openMission;
    if (event.number <= (events[0]?.number ?? 0)) return;
    const seen = event.type === "telemetry" ? Object.fromEntries(event.event.positions.map((each) => [each.uav_id, { ...each, number: event.number }])) : {};
    patch({ connected: true, events: [event, ...events].slice(0, MOST_KEPT), positions: newest(positions, seen) });
    // Positions count with the next event of another type: until then the state stays.
    if (event.type !== "telemetry") void this.read();
  }

  #fail(error) {
    if (this.#ended) return;
    const gone = error instanceof ApiError && error.status === 404;
    patch({ connected: false, trouble: gone ? t("There is no such mission: it may have been deleted") : error.message });
  }
}

/** The newer position of each UAV. */
function newest(known, told) {
  const positions = { ...known };
  for (const [id, seen] of Object.entries(told)) if (!(positions[id]?.time > seen.time)) positions[id] = seen;
  return positions;
}
