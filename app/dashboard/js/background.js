/** What lies below all of a problem on a map of the globe: land, the operator's tiles, the operator's overlay; and whose they are. */

import * as L from "../vendor/leaflet/leaflet.js";
import { Land } from "./land.js";
import { Overlay } from "./overlay.js";
import { OverlayTiles } from "./overlay_tiles.js";

/** @param {L.Map} map of the globe @param {{tile_url: string | null, tile_attribution: string, overlay: string | null}} settings as the service tells them */
export function addBackground(map, settings) {
  L.control.attribution({ position: "bottomleft", prefix: false }).addTo(map);
  new Land().addTo(map);
  if (settings.tile_url) {
    const attribution = document.createElement("span");
    attribution.textContent = settings.tile_attribution;
    L.tileLayer(settings.tile_url, { attribution: attribution.innerHTML, maxZoom: 20 }).addTo(map);
  }
  if (settings.overlay) new (settings.overlay.endsWith(".pmtiles") ? OverlayTiles : Overlay)(settings.overlay).addTo(map);
}
