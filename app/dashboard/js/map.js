/** The map: UAVs, areas and routes of the problem on screen, on a plane or on the globe. */

import * as L from "../vendor/leaflet/leaflet.js";
import { Graticule } from "./graticule.js";
import { shown } from "./dom.js";
import { hue, met, rangeLeft, routesOf, stateOf, sum } from "./plan.js";
import { extent, move, place, position, remove } from "./problem.js";
import { get, select, subscribe } from "./state.js";
import { areaSymbol, aside, uavSymbol } from "./symbols.js";

const MANY = 150;
const FEW_STOPS = 80;
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
    this.symbols = new Map();
    subscribe(["problem"], ({ problem }) => this.#onProblem(problem));
    subscribe(["answer", "incumbent", "answerProblem"], () => this.#draw());
    subscribe(["selection"], () => this.#markSelection());
    element.addEventListener("keydown", (event) => this.#onKey(event));
  }

  /** Draw a plan instead of the store's. @param {object|null} problem null: back to the store's */
  showPlan(problem, plan = null) {
    this.given = problem && { problem, plan };
    this.#onProblem(problem ?? get().problem);
  }

  /** The next click places one. @param {"uavs"|"targets"} kind @param {() => void} [ended] */
  startPlacing(kind, ended = () => {}) {
    this.stopPlacing();
    this.placing = { kind, ended };
    this.element.classList.add("placing");
  }

  stopPlacing() {
    this.placing?.ended();
    this.placing = null;
    this.element.classList.remove("placing");
  }

  /** Bring everything into sight. */
  fit() {
    this.handled = false;
    this.fitting = true;
    this.#fitBox(extent(this.#shown().problem));
    this.fitting = false;
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
    this.map?.remove();
    const { settings } = get();
    const globe = crs === "wgs84";
    this.crs = crs;
    this.map = L.map(this.element, {
      crs: globe ? L.CRS.EPSG3857 : L.CRS.Simple,
      minZoom: globe ? 1 : -32, maxZoom: globe ? 20 : 32, zoomSnap: 0.25, zoomDelta: 0.5,
      attributionControl: Boolean(globe && settings.tile_url), fadeAnimation: false, renderer: L.svg({ padding: 0.5 }),
    });
    this.map.attributionControl?.setPrefix(false);
    if (globe && settings.tile_url) {
      const attribution = document.createElement("span");
      attribution.textContent = settings.tile_attribution;
      L.tileLayer(settings.tile_url, { attribution: attribution.innerHTML, maxZoom: 20 }).addTo(this.map);
    }
    new Graticule(globe).addTo(this.map);
    if (globe) L.control.scale({ imperial: false }).addTo(this.map);
    this.map.createPane("routes").style.zIndex = 450;
    this.renderer = L.svg({ padding: 0.5, pane: "routes" });
    this.routes = L.layerGroup().addTo(this.map);
    this.markers = L.layerGroup().addTo(this.map);
    this.map.on("movestart zoomstart", () => { this.handled ||= !this.fitting; });
    this.map.on("click", ({ latlng }) => this.#onClick(latlng));
  }

  #onProblem(problem) {
    if (!problem) return;
    const box = extent(problem);
    const remade = !this.map || this.crs !== problem.crs;
    if (remade) this.#make(problem.crs);
    const far = box && this.map._loaded && !this.map.getBounds().intersects([[box.minY, box.minX], [box.maxY, box.maxX]]);
    if (remade || far || !get().past.length) this.fit();
    this.#draw();
  }

  #draw() {
    const { problem, plan, planned = problem } = this.#shown();
    if (!this.map || !problem) return;
    this.routes.clearLayers();
    this.markers.clearLayers();
    this.symbols.clear();
    if (plan) this.#drawRoutes(planned, plan);
    const answer = plan && !Array.isArray(plan) && planned === problem ? plan : null;
    this.#drawAreas(problem, answer);
    this.#drawUavs(problem);
    this.#markSelection();
  }

  #drawRoutes(problem, plan) {
    const routes = routesOf(problem, plan);
    const stops = sum(routes.map((route) => route.stops.length));
    this.element.classList.toggle("numbered", stops <= FEW_STOPS);
    for (const { uav, index, points, stops: visits } of routes) {
      const line = L.polyline(points.map(({ x, y }) => [y, x]), { renderer: this.renderer, className: "route", weight: stops > FEW_STOPS ? 1.75 : 2.5, smoothFactor: 0.5 });
      line.on("click", (event) => { L.DomEvent.stop(event); select({ kind: "uavs", id: uav.id }); });
      line.bindTooltip(`${uav.id}: ${visits.map(({ target }) => target.id).join(" → ")}`, { sticky: true });
      this.routes.addLayer(line);
      const path = line.getElement();
      path.style.setProperty("--hue", hue(index));
      Object.assign(path.dataset, { uavId: uav.id, stops: visits.map(({ target }) => target.id).join("\n") });
      if (stops <= FEW_STOPS) visits.forEach(({ target }, at) => this.#drawOrder(uav, index, target, at + 1));
    }
  }

  #drawOrder(uav, index, target, order) {
    const label = document.createElement("span");
    label.textContent = order;
    label.style.setProperty("--hue", hue(index));
    const beside = [-7 + 13 * (index % 3), 20];
    const icon = L.divIcon({ className: "order", html: label, iconSize: [15, 15], iconAnchor: beside });
    this.routes.addLayer(L.marker([target.y, target.x], { icon, interactive: false, keyboard: false }));
  }

  #drawAreas(problem, answer) {
    const highest = Math.max(0, ...problem.targets.map((target) => target.level));
    const size = problem.targets.length > MANY ? 15 : 24;
    const share = met(problem, answer);
    for (const target of problem.targets) {
      const symbol = areaSymbol(target, { highest, met: share.get(target.id), size });
      const says = [`${target.id} · urgency ${shown(target.level)}`, `needs ${target.loadlist.map((n) => shown(n)).join(", ")}`];
      if (answer) says.push(`${shown(100 * share.get(target.id), 3)}% met`);
      if (target.deadline !== undefined) says.push(`by ${shown(target.deadline)}`);
      this.#addSymbol("targets", target.id, target, symbol, size, [0, 0], says.join("\n"));
    }
  }

  #drawUavs(problem) {
    const size = problem.uavs.length > 40 ? 12 : 17;
    const crowds = new Map();
    problem.uavs.forEach((uav, index) => {
      const at = position(uav);
      const spot = `${at.x} ${at.y}`;
      const nth = crowds.get(spot) ?? 0;
      crowds.set(spot, nth + 1);
      if (at.x !== uav.x_s || at.y !== uav.y_s) {
        const base = L.divIcon({ className: "base", iconSize: [9, 9] });
        this.markers.addLayer(L.marker([uav.y_s, uav.x_s], { icon: base, interactive: false, keyboard: false }));
      }
      const says = `${uav.id} · ${stateOf(uav)}\nrange left ${shown(rangeLeft(uav))} of ${shown(uav.voyage)}\ncarries ${uav.loadlist.map((n) => shown(n)).join(", ")}`;
      this.#addSymbol("uavs", uav.id, at, uavSymbol(uav, index, size), size, aside(nth, size), says);
    });
  }

  #addSymbol(kind, id, at, symbol, size, [dx, dy], says) {
    const icon = L.divIcon({ className: `symbol ${kind}`, html: symbol, iconSize: [size, size], iconAnchor: [size / 2 - dx, size / 2 - dy] });
    const marker = L.marker([at.y, at.x], { icon, draggable: !this.given, keyboard: false, riseOnHover: true });
    marker.on("click", () => select({ kind, id }));
    marker.on("dragend", () => this.#moveTo(kind, id, marker.getLatLng()));
    const tip = document.createElement("span");
    tip.textContent = says;
    marker.bindTooltip(tip, { direction: "top", offset: [dx, dy - size / 2], className: "tip" });
    this.markers.addLayer(marker);
    const element = marker.getElement();
    Object.assign(element.dataset, { kind, id });
    this.symbols.set(`${kind} ${id}`, { marker, element });
  }

  #markSelection() {
    const { selection } = get();
    for (const [key, { marker, element }] of this.symbols) {
      const chosen = selection !== null && key === `${selection.kind} ${selection.id}`;
      if (element.classList.toggle("selected", chosen)) marker.setZIndexOffset(1000);
    }
    this.element.classList.toggle("one-route", selection?.kind === "uavs");
    for (const path of this.element.querySelectorAll("path.route")) {
      path.classList.toggle("selected", selection?.kind === "uavs" && path.dataset.uavId === selection.id);
    }
  }

  #onClick(latlng) {
    if (!this.placing) return select(null);
    place(this.placing.kind, this.#rounded(latlng));
  }

  #moveTo(kind, id, latlng) {
    move(kind, id, this.#rounded(latlng));
    select({ kind, id });
  }

  /** A position to a tenth of a pixel: what a hand can mean. */
  #rounded({ lat, lng }) {
    const { lng: beside } = this.map.layerPointToLatLng(this.map.latLngToLayerPoint([lat, lng]).add([1, 0]));
    const digits = Math.max(0, 1 - Math.floor(Math.log10(Math.abs(beside - lng) || 1)));
    return { x: Number(lng.toFixed(Math.min(digits, 12))), y: Number(lat.toFixed(Math.min(digits, 12))) };
  }

  #onKey(event) {
    const { selection } = get();
    if (!selection || this.given) return;
    if (event.key === "Delete") remove(selection.kind, selection.id);
    if (event.altKey && NUDGES[event.key]) {
      event.preventDefault();
      event.stopPropagation();
      const { marker } = this.symbols.get(`${selection.kind} ${selection.id}`);
      const to = this.map.latLngToLayerPoint(marker.getLatLng()).add(NUDGES[event.key]);
      this.#moveTo(selection.kind, selection.id, this.map.layerPointToLatLng(to));
    }
  }
}
