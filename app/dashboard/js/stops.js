/** Where the stops of a plan are: at areas, which get something, and at bases, where UAVs reload. No page, no requests. */

/** Stands before the id of a base, as an area may have the same id. */
const BASE = "\u0001";

/** Whether a stop of an answer is one at a base. */
export function isReload(stop) {
  return stop?.kind === "reload";
}

/** The place of a stop: an area's id, or a base's with its mark. */
export function placeOf(stop) {
  return isReload(stop) ? atBase(stop.base_id) : stop.target_id;
}

export function atBase(id) {
  return BASE + id;
}

/** The id of the base that a place is; null: it is an area. */
export function baseOf(place) {
  return place.startsWith(BASE) ? place.slice(BASE.length) : null;
}

/** The areas and bases of a problem by their places, in the order in which actions count them. */
export function placesOf({ targets, bases = [] }) {
  return new Map([...targets.map((target) => [target.id, target]), ...bases.map((base) => [atBase(base.id), base])]);
}

/** The place of an action; undefined where it is the way home. */
export function placeOfAction({ targets, bases = [] }, action) {
  const base = bases[action - targets.length - 1];
  return base ? atBase(base.id) : targets[action]?.id;
}

/** The flight that each stop is of, from 1. A reload before a UAV has moved ends none. @returns {number[]} a number a stop */
export function flightsOf({ stops }) {
  let flight = 1;
  let moved = false;
  return stops.map((stop) => {
    const of = flight;
    moved ||= !isReload(stop) || stop.distance > 0;
    if (isReload(stop) && moved) {
      flight += 1;
      moved = false;
    }
    return of;
  });
}
