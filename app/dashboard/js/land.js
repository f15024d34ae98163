/** Where land is (Natural Earth), below everything else on a map of the globe; without a network, as far as the service is there. */

import { Bounds } from "../vendor/leaflet/leaflet.js";
import { svg } from "./dom.js";
import { Sheet } from "./sheet.js";
import { ringsOf } from "./topology.js";

const FOLDER = new URL("../vendor/world-atlas-2.0.2/", import.meta.url);
/** From the zoom on at which a file is shown: that of 1 : 50 000 000, and that of 1 : 10 000 000. */
const FILES = [[0, "land-50m.json.gz"], [7, "land-10m.json.gz"]];
/** Points closer together than this, in pixels, are drawn as one. */
const APART_PX = 0.7;

const loading = new Map();
const loaded = new Map();

/** The rings of a file, which is asked for once. @returns {Promise<import("./topology.js").Ring[]>} */
function load(file) {
  if (!loading.has(file)) {
    loading.set(file, (async () => {
      const answer = await fetch(new URL(file, FOLDER));
      if (!answer.ok) throw new Error(`${answer.status} for ${file}`);
      loaded.set(file, ringsOf(await answer.json(), "land"));
    })());
    // What could not be had is asked for again with the next look at the map.
    loading.get(file).catch(() => loading.delete(file));
  }
  return loading.get(file);
}

/** A Leaflet layer of the land, as one path. */
export const Land = Sheet.extend({
  onAdd() {
    this._path = svg("path", { "fill-rule": "evenodd" });
    this._drawn = svg("svg", { class: "land leaflet-zoom-animated", "aria-hidden": "true" }, this._path);
    this._hang("land", 100);
  },

  getAttribution() {
    return "Natural Earth";
  },

  /** Draw what is in sight; where its file is not here yet, what there is until it is. */
  _look() {
    const zoom = this._map.getZoom();
    const [, file] = FILES.findLast(([from]) => zoom >= from);
    const shown = loaded.has(file) ? file : [...loaded.keys()][0];
    this._draw(loaded.get(shown));
    this._drawn.dataset.file = shown ?? "";
    if (shown !== file) load(file).then(() => this._map && this._look(), () => {});
  },

  _draw(rings = []) {
    const map = this._map;
    const { origin, extent } = this._cover();
    this._drawn.setAttribute("width", extent.x);
    this._drawn.setAttribute("height", extent.y);
    // The whole world is so many pixels wide at this zoom.
    const scale = map.options.crs.scale(this._zoom);
    const from = map.getPixelOrigin().add(origin);
    const box = new Bounds([0, 0], extent);
    this._path.setAttribute("d", pathOf(rings, scale, from, box));
  },
});

/**
 * The path of the rings in a box.
 * @param {import("./topology.js").Ring[]} rings
 * @param {number} scale pixels of the world's width
 * @param {{x: number, y: number}} from the pixel of the world at the box's 0, 0
 * @param {{min: {x, y}, max: {x, y}}} box
 * @returns {string} also of the worlds that lie beside the first one
 */
export function pathOf(rings, scale, from, { min, max }) {
  const parts = [];
  const [west, east] = [(from.x + min.x) / scale, (from.x + max.x) / scale];
  const [north, south] = [(from.y + min.y) / scale, (from.y + max.y) / scale];
  for (const ring of rings) {
    if (ring.maxY < north || ring.minY > south) continue;
    for (let world = Math.ceil(west - ring.maxX); world <= east - ring.minX; world += 1) {
      const whole = ring.minX + world >= west && ring.maxX + world <= east && ring.minY >= north && ring.maxY <= south;
      let points = placed(ring.points, scale, (world * scale) - from.x, -from.y);
      if (!whole) points = clipped(points, min, max);
      if (points.length >= 6) parts.push(`M${points.join(" ")}Z`);
    }
  }
  return parts.join("");
}

/** Points in pixels, to a tenth, without those that are as good as the one before. */
function placed(points, scale, dx, dy) {
  const kept = [];
  let [lastX, lastY] = [Infinity, Infinity];
  for (let at = 0; at < points.length; at += 2) {
    const x = points[at] * scale + dx;
    const y = points[at + 1] * scale + dy;
    if (Math.abs(x - lastX) < APART_PX && Math.abs(y - lastY) < APART_PX) continue;
    kept.push(Math.round(10 * x) / 10, Math.round(10 * y) / 10);
    [lastX, lastY] = [x, y];
  }
  return kept;
}

/** The part of a ring in a box (Sutherland and Hodgman 1974). */
function clipped(ring, min, max) {
  let points = ring;
  for (const [axis, sign, limit] of [[0, 1, min.x], [0, -1, max.x], [1, 1, min.y], [1, -1, max.y]]) {
    const kept = [];
    const beyond = (at) => sign * (points[at + axis] - limit);
    for (let at = 0, before = points.length - 2; at < points.length; before = at, at += 2) {
      const [a, b] = [beyond(before), beyond(at)];
      if (a < 0 !== b < 0) {
        const share = a / (a - b);
        kept.push(...[0, 1].map((each) => Math.round(10 * (points[before + each] + share * (points[at + each] - points[before + each]))) / 10));
      }
      if (b >= 0) kept.push(points[at], points[at + 1]);
    }
    points = kept;
  }
  return points;
}
