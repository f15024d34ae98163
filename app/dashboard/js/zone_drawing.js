/** A no-fly zone that is being drawn on the map: a corner a click, ended at its first corner, by a double click or Enter. */

import * as L from "../vendor/leaflet/leaflet.js";
import { notify } from "./dom.js";
import { tn } from "./texts.js";
import { cornerIcon, drawSides } from "./zone_outline.js";
import { crossings, saidOfCrossings } from "./zones.js";

/** The second click of a double click, and the zoom that it would mean, come so much later at most. */
const DOUBLE_CLICK_MS = 500;
/** A click so near the last corner is that corner. */
const SAME_PX = 6;

/** A zone whose corners are set one after the other. */
export class ZoneDrawing {
  /**
   * @param {L.Map} map
   * @param {{crs: string, fewest: number, position: (latlng) => {x, y}, latLng: (place: {x, y}) => number[],
   *   changed: () => void, ended: (polygon: number[][] | null) => void}} options positions on the map and back;
   *   `changed` is told of each corner, `ended` the zone, or null where it was given up
   */
  constructor(map, options) {
    this.map = map;
    this.options = options;
    this.corners = [];
    this.pairs = [];
    this.pointer = null;
    this.layers = L.layerGroup().addTo(map);
    this.band = L.layerGroup().addTo(map);
    this.onMove = ({ latlng }) => { this.pointer = latlng; this.#drawBand(); };
    map.on("mousemove", this.onMove);
    map.doubleClickZoom.disable();
    map.getContainer().classList.add("drawing");
  }

  /** What is to be said of it now. */
  get says() {
    const { length } = this.corners;
    return [tn(length, "{count} corner.", "{count} corners."), saidOfCrossings(this.pairs, length)].filter(Boolean).join(" ");
  }

  /** Whether sides that are there cross. */
  get crosses() {
    return this.pairs.length > 0;
  }

  /** Set a corner where the map was clicked. */
  add(latlng) {
    const last = this.corners.at(-1);
    if (last && this.#apart(this.#latLng(last), latlng) < SAME_PX) return;
    if (this.corners.length >= this.options.fewest && this.#apart(this.#latLng(this.corners[0]), latlng) < SAME_PX) return this.finish();
    const { x, y } = this.options.position(latlng);
    this.#become([...this.corners, [x, y]]);
  }

  /** Set a corner in the middle of the map. */
  addMiddle() {
    this.add(this.map.getCenter());
  }

  takeBack() {
    this.#become(this.corners.slice(0, -1));
  }

  /** End it as a zone; with too few corners it goes on. */
  finish() {
    const { fewest } = this.options;
    if (this.corners.length < fewest) return notify(tn(fewest, "A zone has at least {count} corner", "A zone has at least {count} corners"), "error");
    this.#end(this.corners);
  }

  giveUp() {
    this.#end(null);
  }

  #end(polygon) {
    this.layers.remove();
    this.band.remove();
    this.map.off("mousemove", this.onMove);
    this.map.getContainer().classList.remove("drawing");
    setTimeout(() => this.map.doubleClickZoom.enable(), DOUBLE_CLICK_MS);
    this.options.ended(polygon);
  }

  #become(corners) {
    this.corners = corners;
    this.pairs = crossings(this.options.crs, corners, false);
    this.layers.clearLayers();
    drawSides(this.layers, corners.map((corner) => this.#latLng(corner)), this.pairs, false);
    corners.forEach((corner, at) => {
      const first = at === 0;
      const marker = L.marker(this.#latLng(corner), { icon: cornerIcon(first ? "corner first" : "corner"), interactive: first, keyboard: false, zIndexOffset: 2000 });
      if (first) marker.on("click", (event) => { L.DomEvent.stop(event); if (this.corners.length > 1) this.finish(); });
      this.layers.addLayer(marker);
    });
    this.#drawBand();
    this.options.changed();
  }

  /** The side to where the pointer is. */
  #drawBand() {
    this.band.clearLayers();
    if (!this.corners.length || !this.pointer) return;
    const { x, y } = this.options.position(this.pointer);
    const whole = [...this.corners, [x, y]];
    const bad = crossings(this.options.crs, whole, false).some((pair) => pair.includes(whole.length - 2));
    this.band.addLayer(L.polyline([this.#latLng(this.corners.at(-1)), this.pointer], { className: `zone-side band${bad ? " crossing" : ""}`, pane: "outlines", interactive: false }));
  }

  #latLng([x, y]) {
    return this.options.latLng({ x, y });
  }

  #apart(one, other) {
    return this.map.latLngToLayerPoint(one).distanceTo(this.map.latLngToLayerPoint(other));
  }
}
