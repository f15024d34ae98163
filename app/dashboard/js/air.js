/** What is in the air of a problem, on the map: no-fly zones, and the wind. */

import * as L from "../vendor/leaflet/leaflet.js";
import { h, svg } from "./dom.js";
import { called } from "./plan.js";
import { shown, t } from "./texts.js";

/** Zones and wind on a Leaflet map. */
export class Air {
  /**
   * @param {L.Map} map
   * @param {boolean} globe whether speeds are in km/h
   * @param {(event: object, id: string) => void} clicked is told of a zone that is clicked
   */
  constructor(map, globe, clicked) {
    this.map = map;
    this.clicked = clicked;
    this.unit = globe ? " km/h" : "";
    map.createPane("zones").style.zIndex = 440;
    this.renderer = L.svg({ padding: 0.5, pane: "zones" });
    this.zones = L.layerGroup().addTo(map);
    this.control = null;
    this.drawn = null;
  }

  /** Draw what a problem has. @param {(point: {x, y}) => number[]} latLng where a position is drawn */
  draw({ no_fly_zones: zones = [], wind = null }, latLng, shift) {
    const { drawn } = this;
    if (drawn?.zones !== zones || drawn.shift !== shift) this.#drawZones(zones, latLng);
    if (drawn?.wind !== wind) this.#drawWind(wind);
    this.drawn = { zones, wind, shift };
  }

  #drawZones(zones, latLng) {
    this.zones.clearLayers();
    for (const zone of zones) {
      const corners = zone.polygon.map(([x, y]) => latLng({ x, y }));
      const drawn = L.polygon(corners, { renderer: this.renderer, className: "no-fly-zone", weight: 1.5, smoothFactor: 0 });
      drawn.bindTooltip(() => h("span", {}, t("{zone}: not to be flown through", { zone: called(zone) })), { sticky: true, className: "tip" });
      this.zones.addLayer(drawn);
      drawn.on("click", (event) => this.clicked(event, zone.id));
      drawn.getElement().dataset.zoneId = zone.id;
    }
  }

  /** Make the zone that is selected stand out. @param {string | null} id */
  mark(id) {
    this.zones.eachLayer((drawn) => drawn.getElement().classList.toggle("selected", drawn.getElement().dataset.zoneId === id));
  }

  #drawWind(wind) {
    this.control?.remove();
    this.control = null;
    if (!wind) return;
    const says = t("wind {speed} towards {direction}°", { speed: `${shown(wind.speed)}${this.unit}`, direction: wind.towards });
    const arrow = svg("svg", { viewBox: "0 0 24 24", width: 24, height: 24, "aria-hidden": "true" },
      svg("path", { d: "M12 21V4M6 10l6-7 6 7", transform: `rotate(${wind.towards} 12 12)` }));
    this.control = L.control({ position: "topright" });
    this.control.onAdd = () => h("div", { class: "wind" }, arrow, h("span", {}, says));
    this.control.addTo(this.map);
  }
}
