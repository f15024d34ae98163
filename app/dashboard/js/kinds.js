/** The kinds of items of a problem, and the ids of those that have none. */

/** UAVs and areas, which every problem has, by the `kind` that rows of a table and features of a map have: the list of the problem they are of. */
export const KINDS = { uav: "uavs", area: "targets" };

/** Zones, which are polygons: their `kind`, and the list of the problem they are of. */
export const ZONE = "zone";
export const ZONES = "no_fly_zones";

/** Bases: their `kind`, and the list of the problem they are of. */
export const BASE = "base";
export const BASES = "bases";

/** All kinds that are at one point each. */
export const POINTS = { ...KINDS, [BASE]: BASES };

/** What ids begin with, by the list. */
export const STEMS = Object.fromEntries(Object.entries({ ...POINTS, [ZONE]: ZONES }).map(([kind, list]) => [list, kind]));

/** The id of an item at a place in a list, from 0; the service's own where it has none. */
export function idOf(list, item, at) {
  return item.id ?? `${STEMS[list]}-${at + 1}`;
}
