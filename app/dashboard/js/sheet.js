/** A drawing as large as the map and some of what lies around it: a pan only moves it, a zoom stretches it, and it is drawn anew at their end. */

import { DomUtil, Layer } from "../vendor/leaflet/leaflet.js";

/** How much of the map's size is drawn beyond its edges, so that a pan shows at once what is there. */
const BEYOND = 0.5;

/** A Leaflet layer with one element, `_drawn`, which `_look` draws. */
export const Sheet = Layer.extend({
  getEvents() {
    return { moveend: this._look, resize: this._look, viewreset: this._look, zoom: this._follow, zoomanim: this._follow };
  },

  onRemove() {
    this._drawn.remove();
  },

  /** Put the element in a pane, below or above others. */
  _hang(pane, zIndex) {
    if (!this._map.getPane(pane)) this._map.createPane(pane).style.zIndex = zIndex;
    this._map.getPane(pane).append(this._drawn);
    if (this._map._loaded) this._look();
  },

  /** Have the element cover the map as it is now. @returns {{origin: L.Point, extent: L.Point}} its corner, in pixels of the layer, and its size */
  _cover() {
    const map = this._map;
    const size = map.getSize();
    const origin = map.containerPointToLayerPoint(size.multiplyBy(-BEYOND)).round();
    this._corner = map.layerPointToLatLng(origin);
    this._zoom = map.getZoom();
    DomUtil.setTransform(this._drawn, origin, 1);
    return { origin, extent: size.multiplyBy(1 + 2 * BEYOND).round() };
  },

  _follow(event) {
    if (!this._corner) return;
    const zoom = event.zoom ?? this._map.getZoom();
    const at = this._map._latLngToNewLayerPoint(this._corner, zoom, event.center ?? this._map.getCenter());
    DomUtil.setTransform(this._drawn, at, this._map.getZoomScale(zoom, this._zoom));
  },
});
