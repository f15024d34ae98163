/** The map: UAVs, areas and routes of the problem on screen, on a plane or on the globe. */

import * as L from "../vendor/leaflet/leaflet.js";
import { Air } from "./air.js";
import { addBackground } from "./background.js";
import { Graticule } from "./graticule.js";
import { bringIntoSight } from "./into_sight.js";
import { BASES, ZONES } from "./kinds.js";
import { Labels } from "./labels.js";
import { addControls } from "./legend.js";
import { Markers, STARTS } from "./markers.js";
import { addZone, extent, fewestCorners, move, moveStarts, place, position, remove, update } from "./problem.js";
import { Routes } from "./routes.js";
import { get, select, subscribe } from "./state.js";
import { ZoneCorners } from "./zone_corners.js";
import { ZoneDrawing } from "./zone_drawing.js";

const CALM = matchMedia("(prefers-reduced-motion: reduce)");

/** The view in which symbols can be moved and deleted. */
const EDITED_IN = "problem";
const SLOW_MS = 250;
const NUDGE_PX = 5;
const NUDGES = { ArrowUp: [0, -NUDGE_PX], ArrowDown: [0, NUDGE_PX], ArrowLeft: [-NUDGE_PX, 0], ArrowRight: [NUDGE_PX, 0] };

/** A Leaflet map that follows the store. */
export class DispatchMap {
  /** @param {HTMLElement} element */
  constructor(element) {
    this.element = element;
    this.map = null;
    this.given = null;
    this.handled = false;
    this.fitting = false;
    this.placing = null;
    this.drawing = null;
    this.later = null;
    this.shift = 0;
    subscribe(["problem"], ({ problem }) => this.#onProblem(problem));
    subscribe(["answer", "incumbent", "answerProblem"], (_, changed) => (changed.includes("answer") ? this.#draw() : this.#drawSoon()));
    subscribe(["selection"], () => this.#onSelection());
    subscribe(["begins"], () => this.#draw());
    subscribe(["view"], () => this.#onView());
    new ResizeObserver(() => this.resized()).observe(element);
    element.addEventListener("keydown", (event) => this.#onKey(event));
  }

  /** Draw a plan instead of the store's. @param {object|null} problem null: back to the store's @param {{underWay?: boolean}} [options] whether legs that UAVs are on stand out */
  showPlan(problem, plan = null, { underWay = false } = {}) {
    this.given = problem && { problem, plan, underWay };
    this.#onProblem(problem ?? get().problem);
  }

  /** The next click, or Enter on the map for its middle, places one. @param {"uavs"|"targets"|"bases"} kind @param {() => void} [ended] @param {(kind: string, at: {x, y}) => void} [take] takes it; the problem on screen otherwise */
  startPlacing(kind, ended = () => {}, take = place) {
    this.stopPlacing();
    this.placing = { kind, ended, take };
    this.element.classList.add("placing");
  }

  stopPlacing() {
    this.placing?.ended();
    this.placing = null;
    this.element.classList.remove("placing");
    this.drawing?.giveUp();
  }

  /** Draw a zone: clicks, and Space for the middle of the map, are its corners. @param {(drawing: ZoneDrawing | null) => void} changed is told of each corner; null: it has ended @param {(polygon: number[][]) => void} [take] takes it; the problem on screen otherwise */
  drawZone(changed, take = addZone) {
    this.stopPlacing();
    this.drawing = new ZoneDrawing(this.map, {
      ...this.#places(), fewest: fewestCorners(), changed: () => changed(this.drawing),
      ended: (polygon) => {
        this.drawing = null;
        if (polygon) take(polygon);
        changed(null);
      },
    });
    changed(this.drawing);
  }

  /** What those who change zones on this map need: positions on it and back. */
  #places() {
    return { crs: this.crs, position: (latlng) => this.#rounded(latlng), latLng: (point) => this.#latLng(point) };
  }

  /** Bring everything into sight. */
  fit() {
    // A zoom that is under way would take the map elsewhere at its end.
    if (this.map._animatingZoom) return this.map.once("zoomend", () => this.fit());
    this.handled = false;
    this.fitting = true;
    this.#fitBox(this.#extent(this.#shown().problem));
    this.fitting = false;
  }

  /** The box of all positions as they are drawn; around the globe the narrowest, so that it may pass the date line. */
  #extent(problem) {
    const box = extent(problem);
    this.shift = 0;
    if (!box || problem.crs !== "wgs84" || box.maxX - box.minX <= 180) return box;
    const east = [...problem.uavs.flatMap((uav) => [uav.x_s, position(uav).x]), ...problem.targets.map(({ x }) => x), ...(problem[BASES] ?? []).map(({ x }) => x), ...(problem.no_fly_zones ?? []).flatMap(({ polygon }) => polygon.map(([x]) => x))].map((x) => (x < 0 ? x + 360 : x));
    const [minX, maxX] = [Math.min(...east), Math.max(...east)];
    if (maxX - minX >= box.maxX - box.minX) return box;
    this.shift = 360;
    return { ...box, minX, maxX };
  }

  /** Where a position is drawn. */
  #latLng({ x, y }) {
    return [y, x < 0 ? x + this.shift : x];
  }

  #fitBox(box) {
    if (!box) return this.map.setView([0, 0], 2, { animate: false });
    const bounds = L.latLngBounds([box.minY, box.minX], [box.maxY, box.maxX]);
    const lone = box.minX === box.maxX && box.minY === box.maxY;
    this.map.fitBounds(lone ? bounds.pad(1) : bounds, { padding: [46, 46], animate: false, maxZoom: lone ? 10 : undefined });
  }

  /** The element has another size; a view that nobody chose by hand goes on showing everything. */
  resized() {
    // A map that is hidden has no size, and would lose its place.
    if (!this.map || !this.element.clientWidth) return;
    this.fitting = true;
    this.map.invalidateSize({ animate: false });
    this.fitting = false;
    if (!this.handled) this.fit();
  }

  #shown() {
    const { problem, answer, answerProblem, incumbent } = get();
    if (this.given) return this.given;
    if (incumbent) return { problem, plan: incumbent.assignment, planned: incumbent.problem };
    return { problem, plan: answer, planned: answerProblem };
  }

  #make(crs) {
    this.stopPlacing();
    // Leaflet ends a zoom under way after the map has gone, and finds nothing left of it.
    if (this.map) this.map._animatingZoom = false;
    this.map?.remove();
    const { settings } = get();
    const globe = crs === "wgs84";
    this.crs = crs;
    this.map = L.map(this.element, {
      crs: globe ? L.CRS.EPSG3857 : L.CRS.Simple,
      minZoom: globe ? 1 : -32, maxZoom: globe ? 20 : 32, zoomSnap: 0.25, zoomDelta: 0.5,
      zoomAnimation: !CALM.matches, markerZoomAnimation: !CALM.matches, inertia: !CALM.matches,
      attributionControl: false, zoomControl: false, fadeAnimation: false, renderer: L.svg({ padding: 0.5 }),
    });
    if (globe) addBackground(this.map, settings);
    new Graticule(globe).addTo(this.map);
    if (globe) L.control.scale({ imperial: false }).addTo(this.map);
    this.air = new Air(this.map, globe, (event, id) => this.#onZone(event, id));
    this.map.createPane("outlines").style.zIndex = 460;
    this.corners = new ZoneCorners(this.map, {
      ...this.#places(), nudge: (event) => (event.altKey && NUDGES[event.key]) || null,
      changed: (id, polygon) => update(ZONES, id, { polygon }),
    });
    this.routes = new Routes(this.map);
    this.markers = new Markers(this.map, {
      latLng: (point) => this.#latLng(point), editable: () => this.#editable(), busy: () => Boolean(this.placing || this.drawing),
      moved: (kind, id, latlng) => this.#moveTo(kind, id, latlng),
    });
    this.labels = new Labels(this.map, this.markers, this.routes);
    addControls(this.map, () => this.fit());
    this.map.on("movestart zoomstart", () => { this.handled ||= !this.fitting; });
    this.map.on("click", ({ latlng, layerPoint, originalEvent }) => this.#onClick(latlng, originalEvent, layerPoint));
    this.map.on("dblclick", () => this.drawing?.finish());
  }

  #onProblem(problem) {
    if (!problem) return;
    const box = this.#extent(problem);
    const remade = !this.map || this.crs !== problem.crs;
    if (remade) this.#make(problem.crs);
    const far = box && this.map._loaded && !this.map.getBounds().intersects([[box.minY, box.minX], [box.maxY, box.maxX]]);
    if (remade || far || this.opened !== get().opened) this.fit();
    this.opened = get().opened;
    this.#draw();
  }

  #draw() {
    const { problem, plan, planned = problem, underWay = false } = this.#shown();
    if (!this.map || !problem) return;
    clearTimeout(this.later);
    this.later = null;
    const began = performance.now();
    if (this.drawn?.plan !== plan || this.drawn?.planned !== planned || this.drawn?.uavs !== problem.uavs || this.drawn?.shift !== this.shift || this.drawn?.routes !== this.routes) {
      this.routes.draw(planned, plan, problem, (point) => this.#latLng(point), underWay);
      this.drawn = { plan, planned, uavs: problem.uavs, shift: this.shift, routes: this.routes };
    }
    this.air.draw(problem, (point) => this.#latLng(point), this.shift);
    const answer = plan && !Array.isArray(plan) && planned === problem ? plan : null;
    this.markers.draw(problem, answer);
    this.#markSelection();
    this.took = performance.now() - began;
  }

  /** Draw, but of many changes in a row not each, where that would keep the page from doing anything else. */
  #drawSoon() {
    if ((this.took ?? 0) * 5 < SLOW_MS) return this.#draw();
    this.later ??= setTimeout(() => this.#draw(), Math.max(SLOW_MS, 4 * this.took));
  }

  /** Whether what is drawn can be changed here: the problem in its own view; elsewhere a plan is looked at. */
  #editable() {
    return !this.given && get().view === EDITED_IN;
  }

  #onView() {
    this.stopPlacing();
    this.markers?.allowMoving();
    this.#markSelection();
  }

  #onSelection() {
    if (!this.map) return;
    if (this.routes.marksFollowSelection) this.routes.drawMarks();
    this.#markSelection();
    this.#bringIntoSight();
  }

  /** Move the map where nothing of what is selected is in sight. */
  #bringIntoSight() {
    const { selection } = get();
    if (!selection || this.placing || this.drawing) return;
    const item = this.#shown().problem[selection.kind]?.find(({ id }) => id === selection.id);
    if (!item) return;
    const spots = item.polygon ? [...item.polygon, item.polygon[0]].map(([x, y]) => ({ x, y })) : [selection.kind === "uavs" ? position(item) : item];
    const ways = selection.kind === "uavs" ? this.routes.waysOf(item.id) : [];
    bringIntoSight(this.map, [spots.map((spot) => this.#latLng(spot)), ...ways], !CALM.matches);
  }

  #markSelection() {
    const { selection } = get();
    if (!this.map) return;
    this.#markZone(selection?.kind === ZONES ? selection.id : null);
    this.markers.mark();
    this.element.classList.toggle("one-route", selection?.kind === "uavs");
    for (const drawn of this.element.querySelectorAll("path.route, .order, .arrow")) {
      drawn.classList.toggle("selected", selection?.kind === "uavs" && drawn.dataset.uavId === selection.id);
    }
    this.labels.soon();
  }

  #markZone(id) {
    if (!this.map) return;
    this.air.mark(id);
    this.corners.show(this.#shown().problem[ZONES]?.find((zone) => zone.id === id) ?? null, this.#editable(), this.shift);
  }

  #onClick(latlng, event = null, point = null) {
    if (this.drawing) return this.drawing.add(latlng);
    if (this.placing) return this.placing.take(this.placing.kind, this.#rounded(latlng));
    if (point && this.markers.clickAt(point)) return;
    // The second click of the double click that ended a zone means nothing more.
    if (!(event?.detail > 1)) select(null);
  }

  #onZone(event, id) {
    if (this.placing || this.drawing) return;
    L.DomEvent.stop(event);
    select({ kind: ZONES, id });
  }

  #moveTo(kind, id, latlng) {
    if (kind === STARTS) return moveStarts(id, this.#rounded(latlng));
    move(kind, id, this.#rounded(latlng));
    select({ kind, id });
  }

  /** A position to a tenth of a pixel: what a hand can mean. */
  #rounded({ lat, lng }) {
    const { lng: beside } = this.map.layerPointToLatLng(this.map.latLngToLayerPoint([lat, lng]).add([1, 0]));
    const digits = Math.max(0, 1 - Math.floor(Math.log10(Math.abs(beside - lng) || 1)));
    const x = this.crs === "wgs84" ? ((((lng + 180) % 360) + 360) % 360) - 180 : lng;
    return { x: Number(x.toFixed(Math.min(digits, 12))), y: Number(lat.toFixed(Math.min(digits, 12))) };
  }

  #onDrawingKey(event) {
    const act = { Enter: () => this.drawing.finish(), " ": () => this.drawing.addMiddle(), Backspace: () => this.drawing.takeBack() }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  #onKey(event) {
    if (this.drawing && event.target === this.element) return this.#onDrawingKey(event);
    if (event.key === "Enter" && this.placing && event.target === this.element) {
      event.preventDefault(); // a form that opens then is not sent by the same key
      return this.#onClick(this.map.getCenter());
    }
    if (event.key.toLowerCase() === "f" && !event.ctrlKey && !event.metaKey && !event.altKey) return this.fit();
    const { selection } = get();
    if (!selection || !this.#editable() || this.drawing) return;
    if (event.key === "Delete") remove(selection.kind, selection.id);
    if (event.altKey && NUDGES[event.key]) {
      event.preventDefault();
      event.stopPropagation();
      if (selection.kind === ZONES) return this.corners.move(NUDGES[event.key]);
      const { marker } = this.markers.of(selection);
      const to = this.map.latLngToLayerPoint(marker.getLatLng()).add(NUDGES[event.key]);
      this.#moveTo(selection.kind, selection.id, this.map.layerPointToLatLng(to));
    }
  }
}
