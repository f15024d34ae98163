/** Symbols among very many, drawn as dots on one canvas: a pan moves it as a whole, and only dots in its reach are drawn. */

import { Bounds } from "../vendor/leaflet/leaflet.js";
import { h } from "./dom.js";
import { Sheet } from "./sheet.js";

/** A dot is found within so many pixels beyond its rim. */
const NEAR_PX = 2;
const CELL_PX = 32;
const DARK = matchMedia("(prefers-color-scheme: dark)");

/** How large the disc of an area is by its urgency, 1 to 5, as a share of its symbol. */
const DISC = [0.45, 0.55, 0.67, 0.78, 0.78];

/**
 * A Leaflet layer of dots.
 *
 * A dot is `{at: L.LatLng, dx, dy, size, looks}`: where it is, by how many pixels it is drawn aside, its size, and how it looks:
 * `{urgent, met}` of an area, `{uav, ret}` of a UAV, by the name of its colour.
 */
export const Dots = Sheet.extend({
  onAdd() {
    this._drawn = h("canvas", { class: "dots leaflet-zoom-animated", "aria-hidden": "true" });
    this._dots ??= [];
    this._recolour = () => this._look();
    DARK.addEventListener("change", this._recolour);
    this._hang("dots", 590);
  },

  onRemove() {
    DARK.removeEventListener("change", this._recolour);
    Sheet.prototype.onRemove.call(this);
  },

  /** Draw these instead of those before; later ones above earlier ones. */
  show(dots) {
    this._dots = dots;
    if (this._map?._loaded) this._look();
  },

  /** The dot nearest to a point of the layer; null where none is there. @returns {object | null} */
  at({ x, y }) {
    let [nearest, least] = [null, Infinity];
    for (const { dot, x: left, y: top } of this._cells?.get(cellOf(x, y)) ?? []) {
      const far = Math.hypot(left - x, top - y);
      if (far < least && far <= dot.size / 2 + NEAR_PX) [nearest, least] = [dot, far];
    }
    return nearest;
  },

  _look() {
    const { origin, extent } = this._cover();
    const sharp = window.devicePixelRatio || 1;
    Object.assign(this._drawn, { width: extent.x * sharp, height: extent.y * sharp });
    Object.assign(this._drawn.style, { width: `${extent.x}px`, height: `${extent.y}px` });
    const pen = this._drawn.getContext("2d");
    const stamps = new Map();
    const reach = new Bounds([0, 0], extent);
    this._cells = new Map();
    for (const dot of this._dots) {
      const place = this._map.latLngToLayerPoint(dot.at);
      const [x, y] = [place.x + dot.dx, place.y + dot.dy];
      if (!reach.contains([x - origin.x, y - origin.y])) continue;
      this._note(dot, x, y);
      const key = JSON.stringify([dot.looks, dot.size]);
      if (!stamps.has(key)) stamps.set(key, stampOf(dot, sharp));
      const stamp = stamps.get(key);
      pen.drawImage(stamp, Math.round((x - origin.x) * sharp - stamp.width / 2), Math.round((y - origin.y) * sharp - stamp.height / 2));
    }
  },

  /** Remember a dot in all cells in which it can be found. */
  _note(dot, x, y) {
    const far = dot.size / 2 + NEAR_PX;
    const cells = new Set([cellOf(x - far, y - far), cellOf(x + far, y - far), cellOf(x - far, y + far), cellOf(x + far, y + far)]);
    for (const cell of cells) {
      if (!this._cells.has(cell)) this._cells.set(cell, []);
      this._cells.get(cell).push({ dot, x, y });
    }
  },
});

function cellOf(x, y) {
  return `${Math.floor(x / CELL_PX)} ${Math.floor(y / CELL_PX)}`;
}

/** A dot by itself, which is drawn many times. */
function stampOf({ looks, size }, sharp) {
  const stamp = document.createElement("canvas");
  stamp.width = stamp.height = Math.ceil(size * sharp);
  const pen = stamp.getContext("2d");
  pen.scale(sharp, sharp);
  const styles = getComputedStyle(document.documentElement);
  const colour = (name) => styles.getPropertyValue(name).trim();
  const draw = (fill, rim, width, path) => {
    pen.beginPath();
    path(width / 2);
    pen.fillStyle = fill;
    pen.fill();
    pen.strokeStyle = rim;
    pen.lineWidth = width;
    pen.stroke();
  };
  const disc = (radius) => (inset) => pen.arc(size / 2, size / 2, radius - inset, 0, 2 * Math.PI);
  const square = (inset) => pen.roundRect(1 + inset, 1 + inset, size - 2 - 2 * inset, size - 2 - 2 * inset, 2);
  if (looks.uav === undefined) draw(colour(`--urgent-${looks.urgent}`), colour(looks.met ? "--good" : "--surface"), looks.met ? 2 : 1, disc((size * DISC[looks.urgent - 1]) / 2));
  else if (looks.ret) draw(colour("--surface"), colour(looks.uav), 2, square);
  else draw(colour(looks.uav), colour("--surface"), 1, square);
  return stamp;
}
