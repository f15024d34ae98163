/** Lines of round coordinates with their numbers: a map without a background keeps its bearings. */

import { DomUtil, Layer } from "../vendor/leaflet/leaflet.js";
import { svg } from "./dom.js";
import { shown } from "./texts.js";

const APART_PX = 110;

/** A Leaflet layer of coordinate lines. */
export const Graticule = Layer.extend({
  initialize(globe) {
    this._degrees = globe ? "°" : "";
  },

  onAdd(map) {
    this._drawn = svg("svg", { class: "graticule", "aria-hidden": "true" });
    map.getPane("tilePane").append(this._drawn);
    this._draw();
  },

  onRemove() {
    this._drawn.remove();
  },

  getEvents() {
    return { moveend: this._draw, resize: this._draw, viewreset: this._draw };
  },

  _draw() {
    const map = this._map;
    const size = map.getSize();
    const bounds = map.getBounds();
    const from = map.containerPointToLayerPoint([0, 0]);
    DomUtil.setPosition(this._drawn, from);
    this._drawn.setAttribute("width", size.x);
    this._drawn.setAttribute("height", size.y);
    this._drawn.replaceChildren();
    const step = round(((bounds.getEast() - bounds.getWest()) * APART_PX) / size.x);
    for (const x of multiples(step, bounds.getWest(), bounds.getEast())) {
      const at = map.latLngToContainerPoint([bounds.getSouth(), x]).x;
      this._line({ x1: at, x2: at, y1: 0, y2: size.y }, { x: at + 4, y: size.y - 6 }, x);
    }
    for (const y of multiples(step, bounds.getSouth(), bounds.getNorth())) {
      const at = map.latLngToContainerPoint([y, bounds.getWest()]).y;
      this._line({ x1: 0, x2: size.x, y1: at, y2: at }, { x: size.x - 6, y: at - 4, "text-anchor": "end" }, y);
    }
  },

  _line(line, label, value) {
    const text = svg("text", label);
    text.textContent = shown(this._degrees && value > 180 ? value - 360 : value, 6) + this._degrees;
    this._drawn.append(svg("line", line), text);
  },
});

/** The next round number: 1, 2 or 5 times a power of ten. */
function round(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((digit) => digit * power >= rough * 0.999);
}

function multiples(step, from, to) {
  const first = Math.ceil(from / step);
  const count = Math.max(0, Math.min(100, Math.floor(to / step) - first + 1));
  return Array.from({ length: count }, (_, i) => Number(((first + i) * step).toPrecision(12)));
}
