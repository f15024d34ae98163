/** The operator's own layer (GeoJSON): lines and polygons, and points with their names; nothing of it takes a click. */

import * as L from "../vendor/leaflet/leaflet.js";
import { json } from "./api.js";
import { h, notify } from "./dom.js";
import { t } from "./texts.js";

/** Names are shown while no more points than this are in sight. */
const MOST_NAMES = 40;
const PANE = "operator";

/** The pane that an overlay is in, of whatever kind. */
export function overlayPane(map) {
  if (!map.getPane(PANE)) map.createPane(PANE).style.zIndex = 300;
  return PANE;
}

let read = null;

/** A Leaflet layer of what the service has at an address. */
export const Overlay = L.Layer.extend({
  initialize(path) {
    this._path = path;
    this._points = [];
  },

  onAdd(map) {
    overlayPane(map);
    // It is read once, for this map and for those that come after it.
    read ??= json(this._path);
    read.then((collection) => this._map && this._show(collection)).catch((error) => {
      read = null;
      notify(t("The overlay of the map could not be read: {why}", { why: error.message }), "error");
    });
  },

  onRemove() {
    this._shapes?.remove();
  },

  getEvents() {
    return { moveend: this._name, resize: this._name };
  },

  _show(collection) {
    const renderer = L.svg({ padding: 0.5, pane: PANE });
    const looks = { renderer, pane: PANE, interactive: false, weight: 1.2 };
    this._shapes = L.geoJSON(collection, {
      ...looks,
      style: ({ geometry: { type } }) => ({ className: /Polygon/.test(type) ? "overlay-shape" : /Point/.test(type) ? "overlay-point" : "overlay-line" }),
      filter: (feature) => Boolean(feature?.geometry),
      pointToLayer: (feature, at) => {
        const drawn = L.circleMarker(at, { ...looks, radius: 2.5 });
        const { name, Name, NAME } = feature.properties ?? {};
        const called = name ?? Name ?? NAME;
        if (called !== undefined && called !== null && called !== "") this._points.push({ at, drawn, called: String(called) });
        return drawn;
      },
    }).addTo(this._map);
    this._name();
  },

  /** Write the names of the points in sight, where they are few enough to be read. */
  _name() {
    const sight = this._map.getBounds();
    const seen = new Set(this._points.filter(({ at }) => sight.contains(at)));
    for (const point of this._points) {
      const named = seen.has(point) && seen.size <= MOST_NAMES;
      if (!named) point.drawn.unbindTooltip();
      else if (!point.drawn.getTooltip()) point.drawn.bindTooltip(h("span", {}, point.called), { permanent: true, direction: "right", offset: [4, 0], className: "overlay-name", pane: PANE });
    }
  },
});
