/** Names on the map, beside what they name, where they cover nothing else; and numbers of stops that do not cover each other. */

import { h } from "./dom.js";
import { layOut, Taken } from "./label_layout.js";
import { get } from "./state.js";

/** With more symbols in sight than this only bases and what is selected have names. */
const MOST_IN_SIGHT = 250;
const HEIGHT = 15;
const REST_MS = 40;
const EVERYWHERE = { left: -Infinity, top: -Infinity, right: Infinity, bottom: Infinity };

/** The names on a Leaflet map. */
export class Labels {
  /** @param {L.Map} map @param {import("./markers.js").Markers} markers @param {import("./routes.js").Routes} routes */
  constructor(map, markers, routes) {
    Object.assign(this, { map, markers, routes });
    this.pane = map.createPane("names");
    this.pane.style.zIndex = 610;
    this.pane.classList.add("leaflet-zoom-hide");
    this.widths = new Map();
    this.later = null;
    map.on("moveend zoomend resize viewreset", () => this.soon());
    // At another zoom names are not where they were; a pan takes them along.
    map.on("zoomend viewreset", () => this.pane.replaceChildren());
  }

  /** Lay them out once nothing has changed for a moment. */
  soon() {
    clearTimeout(this.later);
    this.later = setTimeout(() => this.draw(), REST_MS);
  }

  draw() {
    clearTimeout(this.later);
    if (!this.map._loaded || !this.pane.isConnected) return;
    const sight = this.map.getPixelBounds();
    const origin = this.map.getPixelOrigin();
    const size = this.map.getSize();
    const corner = this.map.containerPointToLayerPoint([0, 0]);
    const inside = { left: corner.x, top: corner.y, right: corner.x + size.x, bottom: corner.y + size.y };
    const taken = new Taken(inside);
    for (const control of this.#controls(corner)) taken.add(control);
    const { selection } = get();
    const chosen = selection && this.markers.of(selection);
    const seen = [];
    for (const symbol of this.markers.symbols.values()) {
      const at = this.map.latLngToLayerPoint(symbol.at);
      const [x, y, half] = [at.x + symbol.dx, at.y + symbol.dy, symbol.size / 2];
      if (!sight.contains(at.add(origin))) continue;
      taken.add({ left: x - half, top: y - half, right: x + half, bottom: y + half });
      seen.push({ symbol, x, y, half });
    }
    this.#layOutOrders(taken, selection);
    const crowded = seen.length > MOST_IN_SIGHT;
    const named = seen.map((each) => ({ ...each, text: this.#textOf(each.symbol, chosen, selection) }))
      .filter(({ symbol, text }) => text && (!crowded || symbol === chosen || symbol.label.rank === Infinity))
      .sort((a, b) => (b.symbol === chosen) - (a.symbol === chosen) || (b.symbol.label.rank - a.symbol.label.rank || 0));
    const sizes = ({ symbol, text }) => [...(symbol.label.more ? [{ width: Math.max(this.#widthOf(text), this.#widthOf(symbol.label.more)), height: 2 * HEIGHT }] : []), { width: this.#widthOf(text), height: HEIGHT }];
    const places = layOut(taken, named.map((each) => ({ ...each, sizes: sizes(each), always: each.symbol === chosen })));
    this.pane.replaceChildren(...named.flatMap(({ symbol, text }, n) => {
      if (!places[n]) return [];
      const drawn = h("span", { class: symbol === chosen ? "name chosen" : "name", "aria-hidden": "true", dataset: { kind: symbol.kind, id: symbol.id } }, text, symbol.label.more && places[n].size === 0 && h("small", {}, symbol.label.more));
      drawn.style.translate = `${Math.round(places[n].left)}px ${Math.round(places[n].top)}px`;
      return [drawn];
    }));
  }

  /** Boxes of the buttons and notes on the map. */
  #controls(corner) {
    const map = this.map.getContainer().getBoundingClientRect();
    return [...this.map.getContainer().querySelectorAll(".leaflet-control")].map((control) => {
      const box = control.getBoundingClientRect();
      const [left, top] = [box.left - map.left + corner.x, box.top - map.top + corner.y];
      return { left, top, right: left + box.width, bottom: top + box.height };
    });
  }

  /** What is beside a symbol: its name, and of a place where the selected UAV waits that one's. */
  #textOf(symbol, chosen, selection) {
    const { name } = symbol.label;
    if (symbol !== chosen || selection.kind !== "uavs" || symbol.kind === "uavs") return name;
    const uav = symbol.uavs.find(({ id }) => id === selection.id);
    return [name, uav?.name ?? selection.id].filter(Boolean).join(" · ");
  }

  /** Numbers of stops that would cover others are not shown; those of the selected UAV come first. */
  #layOutOrders(taken, selection) {
    const own = selection?.kind === "uavs" ? selection.id : null;
    const chips = new Taken(EVERYWHERE);
    for (const { marker, uavId, left, top, size } of this.routes.orders().sort((a, b) => (b.uavId === own) - (a.uavId === own))) {
      const at = this.map.latLngToLayerPoint(marker.getLatLng());
      const box = { left: at.x + left, top: at.y + top, right: at.x + left + size, bottom: at.y + top + size };
      const crowded = chips.meets(box);
      marker.getElement()?.classList.toggle("crowded", crowded);
      if (crowded) continue;
      chips.add(box);
      taken.add(box);
    }
  }

  #widthOf(text) {
    if (!this.widths.has(text)) {
      this.pen ??= document.createElement("canvas").getContext("2d");
      this.pen.font = "600 11px Inter, sans-serif";
      this.widths.set(text, Math.ceil(this.pen.measureText(text).width) + 6);
    }
    return this.widths.get(text);
  }
}
