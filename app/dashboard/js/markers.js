/** Symbols of a problem on the map: areas, bases, UAVs that fly, and those that wait at one place as one symbol with their number. */

import * as L from "../vendor/leaflet/leaflet.js";
import { stockText } from "./bases.js";
import { colourName } from "./colours.js";
import { crowdList } from "./crowd.js";
import { h } from "./dom.js";
import { Dots } from "./dots.js";
import { BASES } from "./kinds.js";
import { called, met, rangeShare, urgency } from "./plan.js";
import { position } from "./problem.js";
import { get, select } from "./state.js";
import { areaDot, areaSymbol, aside, depotSymbol, startSymbol, uavDot, uavSymbol } from "./symbols.js";
import { areaTip, baseTip, startTip, uavTip } from "./tips.js";
import { waitingPlaces } from "./waiting_places.js";

const MANY = 150;
/** From so many symbols on they are dots on a canvas; only the one under the pointer and the selected one are elements too. */
const DOTS_FROM = 600;
const CROWD_SIZE = 30;
/** Symbols are above each other by where they are on the screen; places where UAVs wait are above all others. */
const ABOVE_ALL = 2000;
/** Kind of the symbol of a place where UAVs wait and no base is. */
export const STARTS = "starts";

/** The symbols on a Leaflet map. */
export class Markers {
  /**
   * @param {L.Map} map
   * @param {{latLng: (point: {x, y}) => number[], editable: () => boolean, moved: (kind: string, id: string, latlng: L.LatLng) => void}} page
   *   where positions are drawn, whether symbols can be moved, and who is told of one that was; a place is told by the ids of its UAVs
   */
  constructor(map, page) {
    Object.assign(this, { map, page });
    this.layer = L.layerGroup().addTo(map);
    this.canvas = new Dots().addTo(map);
    this.symbols = new Map();
    this.places = new Map();
    this.waitsAt = new Map();
    this.under = null;
    map.on("mousemove", ({ layerPoint, originalEvent }) => this.#pointAt(layerPoint, originalEvent));
  }

  /** Draw a problem instead of the one before, and what an answer says of it. @param {object} problem @param {object | null} answer */
  draw(problem, answer) {
    this.before = this.symbols;
    this.symbols = new Map();
    this.places = waitingPlaces(problem);
    this.waitsAt.clear();
    const waiting = [...this.places.values()].reduce((all, { uavs }) => all + uavs.length, 0);
    this.dots = problem.targets.length + problem.uavs.length - waiting > DOTS_FROM;
    this.#drawAreas(problem, answer);
    this.#drawBases(problem, answer);
    this.#drawStarts(problem);
    this.#drawUavs(problem);
    for (const { marker, base } of this.before.values()) for (const layer of [marker, base]) if (layer) this.layer.removeLayer(layer);
    this.before = null;
    if (this.under && this.symbols.get(this.under.key) !== this.under) this.under = null;
    this.canvas.show([...this.symbols.values()].filter(({ draw }) => draw));
    this.mark();
  }

  #drawAreas(problem, answer) {
    const highest = Math.max(0, ...problem.targets.map((target) => target.level));
    const size = this.dots ? 9 : problem.targets.length > MANY ? 15 : 24;
    const share = met(problem, answer);
    for (const target of problem.targets) {
      const [urgent, met] = [urgency(target.level, highest), share.get(target.id)];
      const looks = this.dots ? { urgent, met: met >= 1, size } : { urgent, met, size };
      this.#add("targets", target.id, target, () => (this.dots ? areaDot : areaSymbol)(looks), looks, () => areaTip(problem, target, answer && met), { name: called(target), rank: target.level });
    }
  }

  #drawBases(problem, answer) {
    const left = new Map((answer?.bases ?? []).map(({ base_id: id, stock }) => [id, stock]));
    for (const base of problem[BASES] ?? []) {
      const uavs = this.places.get(`${base.x} ${base.y}`)?.uavs ?? [];
      const looks = { size: CROWD_SIZE, count: uavs.length };
      const made = this.#add(BASES, base.id, base, () => depotSymbol(looks), looks, () => baseTip(problem, base, uavs, left), { name: called(base), more: stockText(problem, base.stock), rank: Infinity });
      this.#hold(made, uavs);
    }
  }

  #drawStarts(problem) {
    const bases = new Set((problem[BASES] ?? []).map(({ x, y }) => `${x} ${y}`));
    for (const [spot, { x, y, uavs }] of this.places) {
      if (bases.has(spot) || uavs.length < 2) continue;
      const looks = { size: CROWD_SIZE, count: uavs.length };
      const made = this.#add(STARTS, spot, { x, y }, () => startSymbol(looks), looks, () => startTip(uavs), { name: "", rank: Infinity });
      this.#hold(made, uavs);
    }
  }

  #drawUavs(problem) {
    const size = this.dots ? 10 : problem.uavs.length > 40 ? 12 : 17;
    const crowds = new Map();
    const { colours } = get();
    for (const uav of problem.uavs) {
      if (this.waitsAt.has(uav.id)) continue;
      const at = position(uav);
      const spot = `${at.x} ${at.y}`;
      const nth = crowds.get(spot) ?? 0;
      crowds.set(spot, nth + 1);
      const looks = this.dots ? { uav: colourName(colours[uav.id] ?? 0), ret: Boolean(uav.ret), size } : { colour: colours[uav.id], size, nth, ret: uav.ret, left: rangeShare(uav).toFixed(3) };
      const made = this.#add("uavs", uav.id, at, () => (this.dots ? uavDot : uavSymbol)(uav, size), looks, () => uavTip(problem, uav), { name: called(uav), rank: -1 }, aside(nth, size));
      this.#drawStart(made, uav, at);
    }
  }

  /** Draw a symbol, or keep the one that shows the same. @param {object} looks all that its drawing depends on, its size among it */
  #add(kind, id, at, draw, looks, says, label, [dx, dy] = [0, 0]) {
    const { size } = looks;
    const key = `${kind} ${id}`;
    const isDot = this.dots && kind !== BASES && kind !== STARTS;
    const look = JSON.stringify([looks, isDot]);
    const known = this.before.get(key);
    const [y, x] = this.page.latLng(at);
    if (known?.look === look && known.dx === dx && known.dy === dy) {
      this.before.delete(key);
      if (known.at.lat !== y || known.at.lng !== x) {
        known.at = L.latLng(y, x);
        known.marker?.setLatLng(known.at);
      }
      if (known.base) this.layer.removeLayer(known.base);
      Object.assign(known, { says, label, base: null });
      this.symbols.set(key, known);
      this.#allow(known);
      return known;
    }
    const height = kind === STARTS || kind === BASES ? ABOVE_ALL : 0;
    const drawn = { height, key, kind, id, look, looks, says, label, at: L.latLng(y, x), size, dx, dy, draw: isDot ? draw : null, marker: null, element: null, base: null, uavs: [] };
    this.symbols.set(key, drawn);
    if (!isDot) this.#raise(drawn, draw);
    return drawn;
  }

  /** Make an element of a symbol, which can be clicked, dragged, and says what it is. */
  #raise(drawn, draw) {
    const { kind, id, size, dx, dy, height } = drawn;
    const icon = L.divIcon({ className: `symbol ${kind}`, html: draw(), iconSize: [size, size], iconAnchor: [size / 2 - dx, size / 2 - dy] });
    const marker = L.marker(drawn.at, { icon, keyboard: false, riseOnHover: !drawn.draw, zIndexOffset: height });
    drawn.marker = marker;
    marker.on("click", () => this.#clicked(drawn));
    marker.on("dragend", () => this.page.moved(kind, kind === STARTS ? drawn.uavs.map((uav) => uav.id) : id, marker.getLatLng()));
    marker.bindTooltip(() => h("span", {}, drawn.says()), { direction: "top", offset: [dx, dy - size / 2], className: "tip" });
    this.layer.addLayer(marker);
    drawn.element = marker.getElement();
    Object.assign(drawn.element.dataset, { kind, id });
    this.#allow(drawn);
  }

  /** Have the dot under the pointer be an element, unless the pointer drags something. */
  #pointAt(point, { buttons }) {
    if (!this.dots || buttons) return;
    const dot = this.canvas.at(point);
    if (dot === this.under) return;
    const was = this.under;
    this.under = dot;
    if (was) this.#lower(was);
    if (!dot) return;
    if (!dot.marker) this.#raise(dot, dot.draw);
    dot.marker.openTooltip();
  }

  /** A click on the map: it means the dot there, where the pointer was not on it before, as a finger is not. @returns {boolean} whether one is there */
  clickAt(point) {
    const dot = this.dots && this.canvas.at(point);
    if (dot) this.#clicked(dot);
    return Boolean(dot);
  }

  /** A dot is on the canvas alone again, unless it is under the pointer or selected. */
  #lower(dot) {
    if (!dot.draw || !dot.marker || dot === this.under || dot === this.chosen) return;
    this.layer.removeLayer(dot.marker);
    Object.assign(dot, { marker: null, element: null });
  }

  /** UAVs that wait where a symbol is are part of it. */
  #hold(made, uavs) {
    made.uavs = uavs;
    for (const { id } of uavs) this.waitsAt.set(id, made.key);
  }

  #clicked({ kind, id, at, uavs }) {
    if (kind !== STARTS) select({ kind, id });
    if (uavs.length && !this.page.busy()) L.popup({ className: "crowd", maxHeight: 240, minWidth: 150, autoPanPadding: [20, 20] }).setLatLng(at).setContent(crowdList(uavs, (uav) => select({ kind: "uavs", id: uav.id }))).openOn(this.map);
  }

  /** Draw the starting point of a UAV that is elsewhere, unless others wait there. */
  #drawStart(made, uav, at) {
    if (at.x === uav.x_s && at.y === uav.y_s) return;
    if (this.symbols.has(`${STARTS} ${uav.x_s} ${uav.y_s}`)) return;
    const icon = L.divIcon({ className: "base", iconSize: [9, 9] });
    made.base = L.marker(this.page.latLng({ x: uav.x_s, y: uav.y_s }), { icon, interactive: false, keyboard: false });
    this.layer.addLayer(made.base);
  }

  /** Let a symbol be dragged where it can be changed. */
  #allow({ marker }) {
    if (this.page.editable()) marker?.dragging.enable();
    else marker?.dragging.disable();
  }

  allowMoving() {
    for (const symbol of this.symbols.values()) this.#allow(symbol);
  }

  /** The symbol of what is selected; of a UAV that waits that of its place. @returns {object | undefined} */
  of({ kind, id }) {
    return this.symbols.get(kind === "uavs" ? (this.waitsAt.get(id) ?? `uavs ${id}`) : `${kind} ${id}`);
  }

  /** Make what is selected stand out. */
  mark() {
    const { selection } = get();
    const own = (selection && this.of(selection)) ?? null;
    const was = this.chosen;
    this.chosen = own;
    if (was && was !== own) this.#lower(was);
    if (own && !own.marker) this.#raise(own, own.draw);
    for (const drawn of this.symbols.values()) {
      const chosen = drawn === own;
      if (!drawn.element || drawn.element.classList.contains("selected") === chosen) continue;
      drawn.element.classList.toggle("selected", chosen);
      drawn.marker.setZIndexOffset(drawn.height + (chosen ? 1000 : 0));
    }
  }
}
