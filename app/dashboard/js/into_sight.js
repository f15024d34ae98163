/** What is selected comes into sight on the map, where nothing of it is. */

import * as L from "../vendor/leaflet/leaflet.js";

/** Whether any part of a way is in sight. @param {L.Map} map @param {number[][]} way */
function seen(map, way) {
  const bounds = L.bounds([0, 0], map.getSize());
  const points = way.map((at) => map.latLngToContainerPoint(at));
  return points.some((point, n) => bounds.contains(point) || (n > 0 && L.LineUtil.clipSegment(points[n - 1], point, bounds) !== false));
}

/**
 * @param {L.Map} map
 * @param {number[][][]} ways positions of what is selected, and ways of it
 * @param {boolean} moving whether the map may glide there
 */
export function bringIntoSight(map, ways, moving) {
  // A zoom that is under way would take the map elsewhere at its end.
  if (map._animatingZoom) return map.once("zoomend", () => bringIntoSight(map, ways, moving));
  const all = ways.filter((way) => way.length);
  if (!all.length || !map._loaded || !map.getSize().x || all.some((way) => seen(map, way))) return;
  const bounds = L.latLngBounds(all.flat());
  const zoom = Math.min(map.getZoom(), map.getBoundsZoom(bounds, false, L.point(40, 40)));
  map.setView(bounds.getCenter(), zoom, moving ? {} : { animate: false });
}
