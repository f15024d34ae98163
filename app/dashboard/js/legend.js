/** What the symbols of the map mean, and the buttons to zoom and to bring everything into sight; controls of the Leaflet map. */

import * as L from "../vendor/leaflet/leaflet.js";
import { h, svg } from "./dom.js";
import { areaSymbol, depotSymbol, startSymbol, uavSymbol } from "./symbols.js";
import { t } from "./texts.js";

/** A UAV for show, half of its range flown. */
const SOME_UAV = { id: "", voyage: 2, dis: 1 };
const LEVELS = [1, 3, 5];

function meanings() {
  const line = (kind) => svg("svg", { viewBox: "0 0 30 12", width: 30, height: 12 }, svg("path", { d: "M1 6H29", class: kind }));
  return [
    [LEVELS.map((urgent) => areaSymbol({ urgent, met: 0, size: 18 })), t("Area: the more urgent, the larger and redder its disc")],
    [[areaSymbol({ urgent: 3, met: 0.6, size: 18 })], t("Its ring fills with what it gets")],
    [[uavSymbol(SOME_UAV, 15)], t("UAV that flies: the bar is the range left")],
    [[uavSymbol({ ...SOME_UAV, ret: true }, 15)], t("UAV that is returning: hollow")],
    [[startSymbol({ size: 22, count: 3 })], t("UAVs that wait at one place, and how many")],
    [[depotSymbol({ size: 22, count: 0 })], t("Base")],
    [[h("span", { class: "order" }, h("span", {}, "2"))], t("Second stop of the UAV in this colour")],
    [[h("span", { class: "order locked" }, h("span", {}, "1"))], t("Locked: the next plan keeps this visit")],
    [[line("route")], t("Route of a UAV; colour and pattern are its own")],
    [[line("route later-flight")], t("A later flight of it")],
    [[line("no-fly-zone")], t("Border of a no-fly zone")],
  ];
}

/** Add them to a map. @param {L.Map} map @param {() => void} fit brings everything into sight */
export function addControls(map, fit) {
  L.control.zoom({ zoomInTitle: t("Zoom in"), zoomOutTitle: t("Zoom out") }).addTo(map);
  const button = L.control({ position: "topleft" });
  button.onAdd = () => {
    const drawn = svg("svg", { viewBox: "0 0 24 24", width: 16, height: 16, "aria-hidden": "true" }, svg("path", { d: "M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5" }));
    const made = h("button", { type: "button", class: "fit", "aria-label": t("Bring everything into sight"), title: t("Bring everything into sight (F)"), onclick: fit }, drawn);
    L.DomEvent.disableClickPropagation(made);
    return h("div", { class: "leaflet-bar" }, made);
  };
  button.addTo(map);
  const legend = L.control({ position: "bottomright" });
  legend.onAdd = () => {
    const list = h("ul", {});
    const made = h("details", { class: "legend" }, h("summary", {}, t("Legend")), list);
    made.addEventListener("toggle", () => {
      if (!list.childElementCount) list.append(...meanings().map(([drawn, says]) => h("li", {}, h("span", { class: "sign", "aria-hidden": "true" }, drawn), h("span", {}, says))));
    });
    L.DomEvent.disableClickPropagation(made);
    L.DomEvent.disableScrollPropagation(made);
    return made;
  };
  legend.addTo(map);
}
