/** Routes on the map, as they are flown, and the order of their stops. */

import * as L from "../vendor/leaflet/leaflet.js";
import { paint } from "./colours.js";
import { h } from "./dom.js";
import { lockedCount } from "./locks.js";
import { called, placeNames, routesOf, sum } from "./plan.js";
import { select } from "./state.js";

/** With more stops than this they have no numbers, and the lines are thinner. */
const FEW_STOPS = 80;

/** The routes of one plan on a Leaflet map. */
export class Routes {
  /** @param {L.Map} map */
  constructor(map) {
    this.map = map;
    map.createPane("routes").style.zIndex = 450;
    this.renderer = L.svg({ padding: 0.5, pane: "routes" });
    this.layers = L.layerGroup().addTo(map);
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
    const uavs = new Map(present.uavs.map((uav) => [uav.id, uav]));
    const stops = sum(routes.map((route) => route.stops.length));
    for (const { uav, index, flights, stops: visits } of routes) {
      const places = visits.map(({ place }) => place);
      const says = () => h("span", {}, `${called(uav)}: ${places.map(placeNames(problem)).join(" → ")}`);
      for (const { number, points } of flights) {
        const line = L.polyline(points.map(latLng), { renderer: this.renderer, className: `route${number > 1 ? " later-flight" : ""}`, weight: stops > FEW_STOPS ? 1.75 : 2.5, smoothFactor: 0.5 });
        line.on("click", (event) => { L.DomEvent.stop(event); select({ kind: "uavs", id: uav.id }); });
        line.bindTooltip(says, { sticky: true, className: "tip" });
        this.layers.addLayer(line);
        const path = line.getElement();
        paint(path, uav.id);
        Object.assign(path.dataset, { uavId: uav.id, flight: number, stops: visits.map(({ item }) => item.id).join("\n") });
      }
      const locked = lockedCount(uavs.get(uav.id), places);
      if (underWay && locked) this.#drawCommitted(uav, flights[0].points, visits[locked - 1].item, latLng);
      if (stops <= FEW_STOPS) {
        visits.forEach(({ item }, at) => this.#drawOrder({ uav, index, item, at, locked: at < locked }, latLng));
      }
    }
  }

  /** The way to the last stop that a UAV is committed to. */
  #drawCommitted(uav, points, { x, y }, latLng) {
    const end = points.findIndex((point, n) => n > 0 && point.x === x && point.y === y);
    const line = L.polyline(points.slice(0, end + 1).map(latLng), { renderer: this.renderer, className: "committed", interactive: false, weight: 8, smoothFactor: 0.5 });
    this.layers.addLayer(line);
    paint(line.getElement(), uav.id).dataset.uavId = uav.id;
  }

  #drawOrder({ uav, index, item, at, locked }, latLng) {
    const label = paint(h("span", {}, String(at + 1)), uav.id);
    const icon = L.divIcon({ className: `order${locked ? " locked" : ""}`, html: label, iconSize: [15, 15], iconAnchor: [-9 + 16 * (index % 3), 26] });
    const marker = L.marker(latLng(item), { icon, interactive: false, keyboard: false, zIndexOffset: 500 });
    this.layers.addLayer(marker);
    Object.assign(marker.getElement().dataset, { uavId: uav.id, targetId: item.id });
  }
}
