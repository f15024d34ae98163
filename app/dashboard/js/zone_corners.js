/** The corners of the selected zone on the map: dragged, moved and removed by keys, and new ones between them; and all of it, by its middle. */

import * as L from "../vendor/leaflet/leaflet.js";
import { called } from "./plan.js";
import { withoutCorner } from "./problem.js";
import { t } from "./texts.js";
import { cornerIcon, drawSides } from "./zone_outline.js";
import { crossings } from "./zones.js";

/** With more corners there are no places for new ones between them. */
const MANY = 120;
/** What the handle of the whole zone has in place of the number of a corner. */
const WHOLE = "all";

/** Handles of one zone. */
export class ZoneCorners {
  /**
   * @param {L.Map} map
   * @param {{crs: string, position: (latlng) => {x, y}, latLng: (place: {x, y}) => number[], nudge: (event: KeyboardEvent) => number[] | null,
   *   changed: (id: string, polygon: number[][]) => void}} options `nudge` is how far a key moves something, in pixels
   */
  constructor(map, options) {
    this.map = map;
    this.options = options;
    this.sides = L.layerGroup().addTo(map);
    this.handles = L.layerGroup().addTo(map);
    this.shown = null;
  }

  /** @param {object | null} zone null: none @param {boolean} editable whether it can be changed here */
  show(zone, editable, shift) {
    const { shown } = this;
    if (shown?.zone === zone && shown.editable === editable && shown.shift === shift) return;
    const focused = shown?.zone.id === zone?.id ? document.activeElement?.dataset?.corner : undefined;
    this.shown = zone && { zone, editable, shift };
    this.#drawSides(zone?.polygon ?? []);
    this.handles.clearLayers();
    if (!zone || !editable) return;
    zone.polygon.forEach((_, at) => this.#addCorner(zone, at));
    if (zone.polygon.length <= MANY) zone.polygon.forEach((_, at) => this.#addBetween(zone, at));
    this.#addWhole(zone);
    if (focused !== undefined) this.#focus(focused === WHOLE ? WHOLE : Math.min(Number(focused), zone.polygon.length - 1));
  }

  /** Move all of the zone. @param {number[]} by pixels */
  move(by) {
    const { zone } = this.shown;
    this.options.changed(zone.id, zone.polygon.map((corner) => this.#moved(corner, by)));
  }

  #addCorner(zone, at) {
    const name = t("Corner {number} of {zone}", { number: at + 1, zone: called(zone) });
    const marker = this.#handle(this.#latLng(zone.polygon[at]), "corner", name);
    marker.on("drag", () => this.#drawSides(zone.polygon.with(at, this.#corner(marker))));
    marker.on("dragend", () => this.options.changed(zone.id, zone.polygon.with(at, this.#corner(marker))));
    const element = marker.getElement();
    element.dataset.corner = at;
    element.addEventListener("keydown", (event) => {
      const by = this.options.nudge(event);
      if (event.key !== "Delete" && event.key !== "Backspace" && !by) return;
      event.preventDefault();
      event.stopPropagation();
      const changed = (polygon) => this.options.changed(zone.id, polygon);
      if (by) changed(zone.polygon.with(at, this.#moved(zone.polygon[at], by)));
      else withoutCorner(zone.polygon, at, changed);
    });
  }

  /** The middle of the zone's box, by which all of it is moved. */
  #addWhole(zone) {
    const { x, y } = L.bounds(zone.polygon.map((corner) => this.map.latLngToLayerPoint(this.#latLng(corner)))).getCenter();
    const marker = this.#handle(this.map.layerPointToLatLng([x, y]), "corner whole", t("All of {zone}", { zone: called(zone) }));
    const from = this.map.latLngToLayerPoint(marker.getLatLng());
    const by = () => { const away = this.map.latLngToLayerPoint(marker.getLatLng()).subtract(from); return [away.x, away.y]; };
    marker.on("drag", () => this.#drawSides(zone.polygon.map((corner) => this.#moved(corner, by()))));
    marker.on("dragend", () => this.move(by()));
    const element = marker.getElement();
    element.dataset.corner = WHOLE;
    element.addEventListener("keydown", (event) => {
      const nudged = this.options.nudge(event);
      if (!nudged) return;
      event.preventDefault();
      event.stopPropagation();
      this.move(nudged);
    });
  }

  /** A place for a new corner on a side. */
  #addBetween(zone, at) {
    const [one, other] = [at, (at + 1) % zone.polygon.length].map((corner) => L.latLng(this.#latLng(zone.polygon[corner])));
    const middle = this.map.layerPointToLatLng(this.map.latLngToLayerPoint(one).add(this.map.latLngToLayerPoint(other)).divideBy(2));
    const marker = this.#handle(middle, "corner between", t("New corner after corner {number} of {zone}", { number: at + 1, zone: called(zone) }));
    const inserted = () => zone.polygon.toSpliced(at + 1, 0, this.#corner(marker));
    marker.on("drag", () => this.#drawSides(inserted()));
    const insert = () => this.options.changed(zone.id, inserted());
    marker.on("dragend click", insert);
    marker.getElement().addEventListener("keydown", ({ key }) => { if (key === "Enter") insert(); });
  }

  #handle(latlng, className, name) {
    const marker = L.marker(latlng, { icon: cornerIcon(className), draggable: true, zIndexOffset: 2000 });
    this.handles.addLayer(marker);
    marker.getElement().setAttribute("aria-label", name);
    marker.getElement().title = name;
    // What is clicked here is no place on the map.
    marker.on("click", (event) => L.DomEvent.stop(event));
    return marker;
  }

  #drawSides(polygon) {
    this.sides.clearLayers();
    drawSides(this.sides, polygon.map((corner) => this.#latLng(corner)), crossings(this.options.crs, polygon), true);
  }

  #focus(at) {
    this.handles.eachLayer((marker) => { if (marker.getElement().dataset.corner === String(at)) marker.getElement().focus(); });
  }

  #corner(marker) {
    const { x, y } = this.options.position(marker.getLatLng());
    return [x, y];
  }

  #moved(corner, by) {
    const to = this.map.latLngToLayerPoint(this.#latLng(corner)).add(by);
    const { x, y } = this.options.position(this.map.layerPointToLatLng(to));
    return [x, y];
  }

  #latLng([x, y]) {
    return this.options.latLng({ x, y });
  }
}
