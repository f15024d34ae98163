/** Rings of a TopoJSON object, on the plane of Web Mercator with the world from 0 to 1. */

/** The latitude at which Web Mercator ends. */
const END = 85.0511287798;

/**
 * A ring as it lies on the plane. One that passes the date line goes on beyond 0 or 1; one around a pole is closed at
 * the end of the plane.
 * @typedef {{points: Float64Array, minX: number, maxX: number, minY: number, maxY: number}} Ring `points` are x, y, x, y, …;
 *   y grows to the south
 */

/**
 * All rings of the polygons of an object, holes among them: a place inside of an odd number of rings is inside.
 * @param {object} topology TopoJSON with a `transform`, in degrees
 * @param {string} name of the object
 * @returns {Ring[]}
 */
export function ringsOf(topology, name) {
  const arcs = topology.arcs.map((arc) => planeOf(arc, topology.transform));
  return arcRings(topology.objects[name]).map((indices) => measured(unwound(joined(indices, arcs))));
}

function arcRings({ type, arcs, geometries }) {
  if (type === "GeometryCollection") return geometries.flatMap(arcRings);
  if (type === "MultiPolygon") return arcs.flat();
  return type === "Polygon" ? arcs : [];
}

/** An arc on the plane; each of its positions is the step from the one before. */
function planeOf(arc, { scale, translate }) {
  const points = new Float64Array(2 * arc.length);
  let [x, y] = [0, 0];
  arc.forEach(([dx, dy], at) => {
    x += dx;
    y += dy;
    points[2 * at] = (x * scale[0] + translate[0]) / 360 + 0.5;
    points[2 * at + 1] = mercator(y * scale[1] + translate[1]);
  });
  return points;
}

function mercator(latitude) {
  const sine = Math.sin((Math.max(-END, Math.min(END, latitude)) * Math.PI) / 180);
  return 0.5 - Math.log((1 + sine) / (1 - sine)) / (4 * Math.PI);
}

/** The points of arcs in a row: each begins where the one before ends; one with an index below zero is gone along backwards. */
function joined(indices, arcs) {
  const parts = indices.map((index) => arcs[index < 0 ? ~index : index]);
  const points = new Float64Array(parts.reduce((sum, part) => sum + part.length - 2, 2));
  let filled = 0;
  parts.forEach((part, nth) => {
    const count = part.length / 2;
    for (let i = nth ? 1 : 0; i < count; i += 1) {
      const at = 2 * (indices[nth] < 0 ? count - 1 - i : i);
      points[filled] = part[at];
      points[filled + 1] = part[at + 1];
      filled += 2;
    }
  });
  return points;
}

/** The same ring without leaps from one side of the date line to the other; changes it in place. */
function unwound(points) {
  const last = points.length - 2;
  for (let at = 2; at <= last; at += 2) points[at] -= Math.round(points[at] - points[at - 2]);
  if (Math.abs(points[last] - points[0]) < 0.5) return points;
  const pole = points[last + 1] < 0.5 ? 0 : 1;
  const closed = new Float64Array(points.length + 4);
  closed.set(points);
  closed.set([points[last], pole, points[0], pole], points.length);
  return closed;
}

function measured(points) {
  const ring = { points, minX: Infinity, maxX: -Infinity, minY: Infinity, maxY: -Infinity };
  for (let at = 0; at < points.length; at += 2) {
    const [x, y] = [points[at], points[at + 1]];
    if (x < ring.minX) ring.minX = x;
    if (x > ring.maxX) ring.maxX = x;
    if (y < ring.minY) ring.minY = y;
    if (y > ring.maxY) ring.maxY = y;
  }
  return ring;
}
