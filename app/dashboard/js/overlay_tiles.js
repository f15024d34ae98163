/** The operator's own layer as pictures (PMTiles): parts of one file, asked for as their places come into sight. */

import * as L from "../vendor/leaflet/leaflet.js";
import { send } from "./api.js";
import { h, notify } from "./dom.js";
import { overlayPane } from "./overlay.js";
import { t } from "./texts.js";

const LIBRARY = new URL("../vendor/pmtiles/pmtiles.js", import.meta.url);
/** Types of pictures by their numbers in the file. */
const PICTURES = { 2: "image/png", 3: "image/jpeg", 4: "image/webp", 5: "image/avif" };
const MOST_ZOOM = 20;

let opened = null;

/** The library, which is no module: a script that leaves one name. */
function library() {
  return new Promise((resolve, reject) => {
    const script = h("script", { src: LIBRARY.href });
    script.addEventListener("load", () => resolve(globalThis.pmtiles));
    script.addEventListener("error", () => reject(new Error(LIBRARY.pathname)));
    document.head.append(script);
  });
}

/** Open the file at a path of the service. @returns {Promise<{archive: object, header: object, attribution: string}>} */
async function open(path) {
  const { EtagMismatch, PMTiles } = await library();
  const source = {
    getKey: () => path,
    async getBytes(offset, length, signal, etag) {
      const answer = await send(path, { signal, headers: { Range: `bytes=${offset}-${offset + length - 1}` } });
      const tag = answer.headers.get("ETag");
      // The file is another one by now: what is known of it is read again.
      if (etag && tag !== etag) throw new EtagMismatch(path);
      return { data: await answer.arrayBuffer(), etag: tag };
    },
  };
  const archive = new PMTiles(source);
  const [header, metadata] = await Promise.all([archive.getHeader(), archive.getMetadata()]);
  // It may have markup, of which only the text is shown.
  const attribution = new DOMParser().parseFromString(metadata?.attribution ?? "", "text/html").body.textContent;
  return { archive, header, attribution };
}

const Tiles = L.GridLayer.extend({
  initialize({ archive, header, attribution }, pane) {
    const bounds = [[header.minLat, header.minLon], [header.maxLat, header.maxLon]];
    L.setOptions(this, { pane, bounds, minZoom: header.minZoom, maxNativeZoom: header.maxZoom, maxZoom: MOST_ZOOM, attribution: h("span", {}, attribution).innerHTML });
    this._archive = archive;
    this._type = PICTURES[header.tileType];
  },

  createTile({ z, x, y }, done) {
    const picture = h("img", { alt: "", role: "presentation" });
    this._archive.getZxy(z, x, y).then((found) => {
      if (!found) return done(null, picture);
      const url = URL.createObjectURL(new Blob([found.data], { type: this._type }));
      const end = (error) => { URL.revokeObjectURL(url); done(error, picture); };
      picture.addEventListener("load", () => end(null));
      picture.addEventListener("error", () => end(new Error(url)));
      picture.src = url;
    }).catch((error) => done(error, picture));
    return picture;
  },
});

/** A Leaflet layer of the pictures that the service has in a file. */
export const OverlayTiles = L.Layer.extend({
  initialize(path) {
    this._path = path;
  },

  onAdd() {
    // It is opened once, for this map and for those that come after it.
    opened ??= open(this._path);
    opened.then((file) => {
      if (this._map) this._tiles = new Tiles(file, overlayPane(this._map)).addTo(this._map);
    }).catch((error) => {
      opened = null;
      notify(t("The overlay of the map could not be read: {why}", { why: error.message }), "error");
    });
  },

  onRemove() {
    this._tiles?.remove();
  },
});
