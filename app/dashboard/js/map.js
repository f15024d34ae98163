/** The map: UAVs, areas and routes of the problem on screen, on a plane or on the globe. */

import * as L from "../vendor/leaflet/leaflet.js";
import { Air } from "./air.js";
import { addBackground } from "./background.js";
import { Graticule } from "./graticule.js";
import { h, shortAmounts, shown } from "./dom.js";
import { BASES, ZONES } from "./kinds.js";
import { stockText } from "./bases.js";
import { called, met, rangeLeft, rangeShare, stateOf, urgency } from "./plan.js";
import { addZone, extent, fewestCorners, move, place, position, remove, requestedBy, update } from "./problem.js";
import { Routes } from "./routes.js";
import { get, select, subscribe } from "./state.js";
import { areaDot, areaSymbol, aside, depotSymbol, uavDot, uavSymbol } from "./symbols.js";
import { ZoneCorners } from "./zone_corners.js";
import { ZoneDrawing } from "./zone_drawing.js";

const CALM = matchMedia("(prefers-reduced-motion: reduce)");

/** The view in which symbols can be moved and deleted. */
const EDITED_IN = "problem";
const MANY = 150;
const DOTS_FROM = 600;
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
    this.symbols = new Map();
    this.later = null;
    this.shift = 0;
    subscribe(["problem"], ({ problem }) => this.#onProblem(problem));
    subscribe(["answer", "incumbent", "answerProblem"], (_, changed) => (changed.includes("answer") ? this.#draw() : this.#drawSoon()));
    subscribe(["selection"], () => this.#markSelection());
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
    this.map?.remove();
    const { settings } = get();
    const globe = crs === "wgs84";
    this.crs = crs;
    this.map = L.map(this.element, {
      crs: globe ? L.CRS.EPSG3857 : L.CRS.Simple,
      minZoom: globe ? 1 : -32, maxZoom: globe ? 20 : 32, zoomSnap: 0.25, zoomDelta: 0.5,
      zoomAnimation: !CALM.matches, markerZoomAnimation: !CALM.matches, inertia: !CALM.matches,
      attributionControl: false, fadeAnimation: false, renderer: L.svg({ padding: 0.5 }),
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
    this.markers = L.layerGroup().addTo(this.map);
    this.symbols.clear();
    this.map.on("movestart zoomstart", () => { this.handled ||= !this.fitting; });
    this.map.on("click", ({ latlng, originalEvent }) => this.#onClick(latlng, originalEvent));
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
    this.before = this.symbols;
    this.symbols = new Map();
    this.dots = problem.targets.length + problem.uavs.length > DOTS_FROM;
    this.#drawAreas(problem, answer);
    this.#drawDepots(problem, answer);
    this.#drawUavs(problem);
    for (const { marker, base } of this.before.values()) for (const layer of [marker, base]) if (layer) this.markers.removeLayer(layer);
    this.before = null;
    this.#markSelection();
    this.took = performance.now() - began;
  }

  /** Draw, but of many changes in a row not each, where that would keep the page from doing anything else. */
  #drawSoon() {
    if ((this.took ?? 0) * 5 < SLOW_MS) return this.#draw();
    this.later ??= setTimeout(() => this.#draw(), Math.max(SLOW_MS, 4 * this.took));
  }

  #drawAreas(problem, answer) {
    const highest = Math.max(0, ...problem.targets.map((target) => target.level));
    const size = this.dots ? 10 : problem.targets.length > MANY ? 15 : 24;
    const share = met(problem, answer);
    for (const target of problem.targets) {
      const looks = { urgent: urgency(target.level, highest), met: share.get(target.id), size };
      const says = () => {
        const lines = [`${called(target)} · urgency ${shown(target.level)}`, `needs ${shortAmounts(target.loadlist)}${target.requested ? ` of ${shortAmounts(requestedBy(target))}` : ""}`];
        if (answer) lines.push(`${shown(100 * looks.met, 3)}% met`);
        if (target.earliest) lines.push(`from ${shown(target.earliest)}`);
        if (target.deadline !== undefined) lines.push(`by ${shown(target.deadline)}`);
        return lines.join("\n");
      };
      this.#addSymbol("targets", target, target, () => (this.dots ? areaDot : areaSymbol)(looks), [0, 0], looks, says);
    }
  }

  #drawDepots(problem, answer) {
    const left = new Map((answer?.bases ?? []).map(({ base_id: id, stock }) => [id, stock]));
    for (const base of problem[BASES] ?? []) {
      const says = () => {
        const lines = [`${called(base)} · base`, `stock ${stockText(base.stock)}`];
        if (left.has(base.id)) lines.push(`after the plan ${stockText(left.get(base.id))}`);
        if (base.turnaround) lines.push(`turnaround ${shown(base.turnaround)}`);
        return lines.join("\n");
      };
      const looks = { size: 34, name: called(base), stock: stockText(base.stock) };
      this.#addSymbol(BASES, base, base, () => depotSymbol(looks), [0, 0], looks, says);
    }
  }

  #drawUavs(problem) {
    const size = this.dots ? 10 : problem.uavs.length > 40 ? 12 : 17;
    const crowds = new Map();
    const { colours } = get();
    for (const uav of problem.uavs) {
      const at = position(uav);
      const spot = `${at.x} ${at.y}`;
      const nth = crowds.get(spot) ?? 0;
      crowds.set(spot, nth + 1);
      const says = () => `${called(uav)} · ${stateOf(uav)}\nrange left ${shown(rangeLeft(uav))} of ${shown(uav.voyage)}\ncarries ${shortAmounts(uav.loadlist)}`;
      this.#addSymbol("uavs", uav, at, () => (this.dots ? uavDot : uavSymbol)(uav, size), aside(nth, size), { colour: colours[uav.id], size, nth, ret: uav.ret, left: rangeShare(uav).toFixed(3) }, says);
    }
  }

  /** Draw a symbol, or keep the one that shows the same. */
  #addSymbol(kind, item, at, draw, [dx, dy], looks, says) {
    const { id } = item;
    const { size } = looks;
    const key = `${kind} ${id}`;
    const look = JSON.stringify([looks, this.dots]);
    const known = this.before.get(key);
    if (known?.look === look) {
      this.before.delete(key);
      this.symbols.set(key, known);
      known.says = says;
      const { lat, lng } = known.marker.getLatLng();
      const [y, x] = this.#latLng(at);
      if (lat !== y || lng !== x) known.marker.setLatLng([y, x]);
      if (known.base) this.markers.removeLayer(known.base);
      known.base = this.#drawBase(kind, item, at);
      this.#allowMoving(known);
      return;
    }
    const drawn = { look, says };
    const icon = L.divIcon({ className: `symbol ${kind}`, html: draw(), iconSize: [size, size], iconAnchor: [size / 2 - dx, size / 2 - dy] });
    const marker = L.marker(this.#latLng(at), { icon, keyboard: false, riseOnHover: !this.dots });
    marker.on("click", () => select({ kind, id }));
    marker.on("dragend", () => this.#moveTo(kind, id, marker.getLatLng()));
    marker.bindTooltip(() => h("span", {}, drawn.says()), { direction: "top", offset: [dx, dy - size / 2], className: "tip" });
    this.markers.addLayer(marker);
    const element = marker.getElement();
    Object.assign(element.dataset, { kind, id });
    this.symbols.set(key, Object.assign(drawn, { marker, element, base: this.#drawBase(kind, item, at) }));
    if (this.dots) marker.on("mouseover", () => this.#allowMoving(drawn, true));
    this.#allowMoving(drawn);
  }

  /** Whether what is drawn can be changed here: the problem in its own view; elsewhere a plan is looked at. */
  #editable() {
    return !this.given && get().view === EDITED_IN;
  }

  /** Let a symbol be dragged, where it can be changed; of very many only the one under the pointer. */
  #allowMoving({ marker }, asked = !this.dots) {
    if (!this.#editable()) marker.dragging.disable();
    else if (asked) marker.dragging.enable();
  }

  /** The starting point of a UAV that is elsewhere. */
  #drawBase(kind, item, at) {
    if (kind !== "uavs" || (at.x === item.x_s && at.y === item.y_s)) return null;
    const icon = L.divIcon({ className: "base", iconSize: [9, 9] });
    const base = L.marker(this.#latLng({ x: item.x_s, y: item.y_s }), { icon, interactive: false, keyboard: false });
    this.markers.addLayer(base);
    return base;
  }

  #onView() {
    this.stopPlacing();
    for (const symbol of this.symbols.values()) this.#allowMoving(symbol);
    this.#markSelection();
  }

  #markSelection() {
    const { selection } = get();
    this.#markZone(selection?.kind === ZONES ? selection.id : null);
    for (const [key, { marker, element }] of this.symbols) {
      const chosen = selection !== null && key === `${selection.kind} ${selection.id}`;
      if (element.classList.contains("selected") === chosen) continue;
      element.classList.toggle("selected", chosen);
      marker.setZIndexOffset(chosen ? 1000 : 0);
    }
    this.element.classList.toggle("one-route", selection?.kind === "uavs");
    for (const drawn of this.element.querySelectorAll("path.route, .order")) {
      drawn.classList.toggle("selected", selection?.kind === "uavs" && drawn.dataset.uavId === selection.id);
    }
  }

  #markZone(id) {
    if (!this.map) return;
    this.air.mark(id);
    this.corners.show(this.#shown().problem[ZONES]?.find((zone) => zone.id === id) ?? null, this.#editable(), this.shift);
  }

  #onClick(latlng, event = null) {
    if (this.drawing) return this.drawing.add(latlng);
    if (this.placing) return this.placing.take(this.placing.kind, this.#rounded(latlng));
    // The second click of the double click that ended a zone means nothing more.
    if (!(event?.detail > 1)) select(null);
  }

  #onZone(event, id) {
    if (this.placing || this.drawing) return;
    L.DomEvent.stop(event);
    select({ kind: ZONES, id });
  }

  #moveTo(kind, id, latlng) {
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
    const { selection } = get();
    if (!selection || !this.#editable() || this.drawing) return;
    if (event.key === "Delete") remove(selection.kind, selection.id);
    if (event.altKey && NUDGES[event.key]) {
      event.preventDefault();
      event.stopPropagation();
      if (selection.kind === ZONES) return this.corners.move(NUDGES[event.key]);
      const { marker } = this.symbols.get(`${selection.kind} ${selection.id}`);
      const to = this.map.latLngToLayerPoint(marker.getLatLng()).add(NUDGES[event.key]);
      this.#moveTo(selection.kind, selection.id, this.map.layerPointToLatLng(to));
    }
  }
}
