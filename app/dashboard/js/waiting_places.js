/** Places where UAVs wait that have not left yet. No page. */

import { stateOf } from "./plan.js";

/** @returns {Map<string, {x: number, y: number, uavs: object[]}>} by position, `x y` */
export function waitingPlaces(problem) {
  const places = new Map();
  for (const uav of problem.uavs) {
    if (stateOf(uav) !== "at its base") continue;
    const spot = `${uav.x_s} ${uav.y_s}`;
    if (!places.has(spot)) places.set(spot, { x: uav.x_s, y: uav.y_s, uavs: [] });
    places.get(spot).uavs.push(uav);
  }
  return places;
}
