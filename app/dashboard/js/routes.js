/** Routes on the map, as they are flown: a line a flight, arrows, and the order of their stops. */

import * as L from "../vendor/leaflet/leaflet.js";
import { paint } from "./colours.js";
import { h, svg } from "./dom.js";
import { lockedCount } from "./locks.js";
import { called, placeNames, routesOf, sum } from "./plan.js";
import { get, select } from "./state.js";
import { t } from "./texts.js";

/** With more stops than this only the selected route has numbers and arrows, and the lines are thinner. */
const FEW_STOPS = 80;
/** With more than this, lines are fine and let through what is below; the selected one is as always. */
const DENSE_STOPS = 600;
const ORDER_PX = 16;
/** Where a number is beside the middle of its stop. */
const ORDER_AT = { left: 8, top: -27 };
/** With more stops at one place than this only those of the selected UAV have numbers there. */
const MOST_BESIDE = 4;
const ARROW_PX = 12;
/** Legs that are shorter on the screen have no arrow. */
const SHORT_PX = 30;
/** Where on its leg an arrow is, so that two on the way there and back do not meet. */
const ARROW_AT = 0.6;

/** The routes of one plan on a Leaflet map. */
export class Routes {
  /** @param {L.Map} map */
  constructor(map) {
    this.map = map;
    map.createPane("routes").style.zIndex = 450;
    this.renderer = L.svg({ padding: 0.5, pane: "routes" });
    this.layers = L.layerGroup().addTo(map);
    this.marks = L.layerGroup().addTo(map);
    this.routes = new Map();
    this.arrows = [];
    /** Whether what is selected changes which numbers and arrows there are. */
    this.marksFollowSelection = false;
    map.on("zoomend", () => this.#hideShort());
  }

  /**
   * Draw a plan instead of the one before.
   * @param {object} problem the one that it answers
   * @param {object | number[][] | null} plan
   * @param {object} present the problem on screen, which says which visits are locked
   * @param {(point: {x, y}) => number[]} latLng where a position is drawn
   * @param {boolean} [underWay] whether the way to what a UAV is committed to stands out
   */
  draw(problem, plan, present, latLng, underWay = false) {
    this.layers.clearLayers();
    const routes = routesOf(problem, plan);
    this.routes = new Map(routes.map((route) => [route.uav.id, route]));
    Object.assign(this, { problem, present, latLng, underWay });
    const stops = sum(routes.map((route) => route.stops.length));
    this.few = stops <= FEW_STOPS;
    this.map.getContainer().classList.toggle("dense", stops > DENSE_STOPS);
    const nameOf = routes.length ? placeNames(problem) : null;
    for (const { uav, flights, stops: visits } of routes) {
      const says = () => h("span", {}, t("{uav}: {places}", { uav: called(uav), places: visits.map(({ place }) => nameOf(place)).join(" → ") }));
      for (const { number, points } of flights) {
        const line = L.polyline(points.map(latLng), { renderer: this.renderer, className: `route${number > 1 ? " later-flight" : ""}`, weight: this.few ? 2.5 : 1.75, smoothFactor: 0.5 });
        line.on("click", (event) => { L.DomEvent.stop(event); select({ kind: "uavs", id: uav.id }); });
        line.bindTooltip(says, { sticky: true, className: "tip" });
        this.layers.addLayer(line);
        const path = line.getElement();
        paint(path, uav.id);
        Object.assign(path.dataset, { uavId: uav.id, flight: number, stops: visits.map(({ item }) => item.id).join("\n") });
      }
      const locked = this.#lockedOf(uav, visits);
      if (underWay && locked) this.#drawCommitted(uav, flights[0].points, visits[locked - 1].item);
    }
    this.drawMarks();
  }

  /** Draw numbers and arrows: of a small plan all of them, of a large one those of the selected UAV. */
  drawMarks() {
    const { selection } = get();
    const own = selection?.kind === "uavs" ? selection.id : null;
    this.marks.clearLayers();
    this.arrows = [];
    this.chips = [];
    const at = new Map();
    const all = new Map();
    for (const { stops } of this.routes.values()) for (const { place } of stops) all.set(place, (all.get(place) ?? 0) + 1);
    this.marksFollowSelection = !this.few || [...all.values()].some((count) => count > MOST_BESIDE);
    for (const { uav, flights, stops } of this.routes.values()) {
      if (!this.few && uav.id !== own) continue;
      const locked = this.#lockedOf(uav, stops);
      stops.forEach(({ place, item }, n) => {
        if (all.get(place) > MOST_BESIDE && uav.id !== own) return;
        const beside = at.get(place) ?? 0;
        at.set(place, beside + 1);
        this.#drawOrder(uav, item, { number: n + 1, locked: n < locked, beside });
      });
      for (const { points } of flights) for (let n = 1; n < points.length; n += 1) this.#drawArrow(uav, points[n - 1], points[n]);
    }
    this.#hideShort();
  }

  /** Numbers of stops, with where they are drawn, in pixels from their place. @returns {{marker: L.Marker, uavId: string, left: number, top: number, size: number}[]} */
  orders() {
    return [...(this.chips ?? [])];
  }

  /** Points of all flights of a UAV as they are drawn. @returns {number[][][]} a list a flight */
  waysOf(id) {
    return (this.routes.get(id)?.flights ?? []).map(({ points }) => points.map(this.latLng));
  }

  #lockedOf(uav, visits) {
    return lockedCount(this.present.uavs.find(({ id }) => id === uav.id), visits.map(({ place }) => place));
  }

  /** The way to the last stop that a UAV is committed to. */
  #drawCommitted(uav, points, { x, y }) {
    const end = points.findIndex((point, n) => n > 0 && point.x === x && point.y === y);
    const line = L.polyline(points.slice(0, end + 1).map(this.latLng), { renderer: this.renderer, className: "committed", interactive: false, weight: 8, smoothFactor: 0.5 });
    this.layers.addLayer(line);
    paint(line.getElement(), uav.id).dataset.uavId = uav.id;
  }

  #drawOrder(uav, item, { number, locked, beside }) {
    const place = { left: ORDER_AT.left + beside * (ORDER_PX + 1), top: ORDER_AT.top };
    const label = paint(h("span", {}, String(number)), uav.id);
    const icon = L.divIcon({ className: `order${locked ? " locked" : ""}`, html: label, iconSize: [ORDER_PX, ORDER_PX], iconAnchor: [-place.left, -place.top] });
    const marker = L.marker(this.latLng(item), { icon, interactive: false, keyboard: false, zIndexOffset: 500 });
    this.marks.addLayer(marker);
    Object.assign(marker.getElement().dataset, { uavId: uav.id, targetId: item.id });
    this.chips.push({ marker, uavId: uav.id, ...place, size: ORDER_PX });
  }

  #drawArrow(uav, from, to) {
    const [a, b] = [from, to].map((point) => this.map.project(this.latLng(point), 0));
    const way = b.subtract(a);
    const far = Math.hypot(way.x, way.y);
    if (!far) return;
    const turned = (Math.atan2(way.y, way.x) * 180) / Math.PI;
    const arrow = svg("svg", { viewBox: "-6 -6 12 12", width: ARROW_PX, height: ARROW_PX }, svg("path", { d: "M-3 -4.5 4 0 -3 4.5z", transform: `rotate(${turned.toFixed(1)})` }));
    const icon = L.divIcon({ className: "arrow", html: paint(arrow, uav.id), iconSize: [ARROW_PX, ARROW_PX] });
    const marker = L.marker(this.map.unproject(a.add(way.multiplyBy(ARROW_AT)), 0), { icon, interactive: false, keyboard: false, pane: "routes" });
    this.marks.addLayer(marker);
    marker.getElement().dataset.uavId = uav.id;
    this.arrows.push({ marker, far });
  }

  #hideShort() {
    const scale = this.map.getZoomScale(this.map.getZoom(), 0);
    for (const { marker, far } of this.arrows) marker.getElement().hidden = far * scale < SHORT_PX;
  }
}
