/**
 * Shapes of no-fly zones while they are drawn: which sides cross. The service judges what it is sent; the page says
 * before that what it sees.
 */

import { t, tn } from "./texts.js";

const radians = (degrees) => (degrees * Math.PI) / 180;

/**
 * The pairs of sides of a polygon that cross, by their places; side n goes from corner n to the next.
 * @param {"local" | "wgs84"} crs
 * @param {number[][]} corners `[x, y]`
 * @param {boolean} [closed] whether the last corner is joined with the first
 * @returns {number[][]}
 */
export function crossings(crs, corners, closed = true) {
  const flat = crs === "wgs84" ? onPlane(corners) : corners;
  const sides = flat.map((corner, at) => [corner, flat[(at + 1) % flat.length]]).slice(0, closed ? undefined : -1);
  const found = [];
  for (let a = 0; a < sides.length; a += 1) for (let b = a + 1; b < sides.length; b += 1) if (cross(sides[a], sides[b])) found.push([a, b]);
  return found;
}

/** What is said of the first sides that cross; empty where none do. */
export function saidOfCrossings(pairs, count) {
  if (!pairs.length) return "";
  const [one, other] = pairs[0].map((side) => t("corner {from} to {to}", { from: side + 1, to: ((side + 1) % count) + 1 }));
  const others = pairs.length - 1;
  if (!others) return t("The side from {one} crosses that from {other}.", { one, other });
  return tn(others, "The side from {one} crosses that from {other}, and {count} more pair crosses.", "The side from {one} crosses that from {other}, and {count} more pairs cross.", { one, other });
}

/** A gnomonic projection: sides, which are arcs of great circles, are straight on it. */
function onPlane(corners) {
  const places = corners.map(([x, y]) => [Math.cos(radians(y)) * Math.cos(radians(x)), Math.cos(radians(y)) * Math.sin(radians(x)), Math.sin(radians(y))]);
  const middle = [0, 1, 2].map((axis) => places.reduce((sum, place) => sum + place[axis], 0));
  const away = Math.abs(middle[2]) < 0.9 * Math.hypot(...middle) ? [0, 0, 1] : [1, 0, 0];
  const east = product(away, middle);
  const north = product(middle, east);
  const length = (vector) => Math.hypot(...vector);
  const along = (place, axis) => (place[0] * axis[0] + place[1] * axis[1] + place[2] * axis[2]) / length(axis);
  return places.map((place) => [along(place, east) / along(place, middle), along(place, north) / along(place, middle)]);
}

function product([a, b, c], [x, y, z]) {
  return [b * z - c * y, c * x - a * z, a * y - b * x];
}

/** Whether the ends of each side lie on different sides of the other's line; sides that only touch do not cross. */
function cross([a, b], [c, d]) {
  return parted(a, b, c, d) && parted(c, d, a, b);
}

function parted([ax, ay], [bx, by], ...ends) {
  const [one, other] = ends.map(([x, y]) => (bx - ax) * (y - ay) - (by - ay) * (x - ax));
  return (one < 0 && other > 0) || (one > 0 && other < 0);
}
