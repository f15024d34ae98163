/** How a zone looks while its corners can be changed: its sides, those that cross, its corners. */

import * as L from "../vendor/leaflet/leaflet.js";

const CORNER_PX = 14;

/**
 * Draw sides one by one, so that those that cross stand out.
 * @param {L.LayerGroup} group
 * @param {number[][]} corners as latitudes and longitudes
 * @param {number[][]} pairs of sides that cross
 * @param {boolean} closed
 */
export function drawSides(group, corners, pairs, closed) {
  const crossing = new Set(pairs.flat());
  const sides = closed ? corners.length : corners.length - 1;
  for (let side = 0; side < sides; side += 1) {
    const ends = [corners[side], corners[(side + 1) % corners.length]];
    group.addLayer(L.polyline(ends, { className: `zone-side${crossing.has(side) ? " crossing" : ""}`, pane: "outlines", interactive: false, smoothFactor: 0 }));
  }
}

/** @param {string} className */
export function cornerIcon(className) {
  return L.divIcon({ className, iconSize: [CORNER_PX, CORNER_PX] });
}
