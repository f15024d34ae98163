/**
 * A problem as GeoJSON (RFC 7946): points and polygons with the service's fields as properties, settings as a
 * member.
 */

import { BASE, BASES, POINTS, ZONE, ZONES } from "../kinds.js";
import { position } from "../problem.js";
import { heldSettings, isAmounts, isWords, itemFields } from "../schema.js";
import { t, tn } from "../texts.js";
import { wordsIn } from "../words.js";
import { rowText } from "./cells.js";
import { FormatError } from "./error.js";

/** Names of longitude and latitude on WGS 84. */
const DEGREES = /(CRS84h?|EPSG:[\d.]*:?(4326|4979))$/i;

export function toGeoJson(problem, fields) {
  const { uavs, targets, ...rest } = problem;
  const settings = { ...rest, crs: rest.crs ?? fields.settings.crs.default };
  const zones = rest[ZONES] ?? [];
  for (const list of [BASES, ZONES]) if (settings[list]?.length) delete settings[list];
  const point = ({ x, y }, kind, { id, ...properties }) => ({
    type: "Feature", id, geometry: { type: "Point", coordinates: [x, y] }, properties: { kind, ...properties },
  });
  const features = [
    ...uavs.map((uav) => point(position(uav), "uav", uav)),
    ...targets.map(({ x, y, ...target }) => point({ x, y }, "area", target)),
    ...(rest[BASES] ?? []).map(({ x, y, ...base }) => point({ x, y }, BASE, base)),
    ...zones.map(zoneFeature),
  ];
  return `${JSON.stringify({ type: "FeatureCollection", settings, features }, null, 2)}\n`;
}

/** A zone, whose ring is closed as the format has it. */
function zoneFeature({ id, polygon = [], ...properties }) {
  const closed = polygon.length > 1 && same(polygon[0], polygon.at(-1));
  const ring = polygon.length && !closed ? [...polygon, polygon[0]] : polygon;
  return { type: "Feature", id, geometry: { type: "Polygon", coordinates: [ring] }, properties: { kind: ZONE, ...properties } };
}

function same(a, b) {
  return JSON.stringify(a) === JSON.stringify(b);
}

/**
 * Read a problem out of a FeatureCollection.
 * @param {object} collection
 * @param {object} present problem, whose settings hold where the collection has none
 * @param {object} fields as `fieldsOf` gives them
 * @returns {{problem: object, notices: string[]}}
 * @throws {FormatError}
 */
export function fromGeoJson(collection, present, fields) {
  const { features, settings } = collection;
  if (!Array.isArray(features)) throw new FormatError(t("it has no list `features`"));
  const problem = { ...(settings ?? { ...heldSettings(present, fields), crs: "wgs84" }), uavs: [], targets: [] };
  // Of a file of this page the service judges the positions.
  if (!settings) onGlobe(collection.crs);
  const notices = [];
  const foreign = new Set();
  features.forEach((feature, at) => {
    const { kind: given, ...properties } = feature?.properties ?? {};
    const name = nameOf(feature, at);
    if (!feature?.geometry) return notices.push(t("{feature} has no geometry and was left out", { feature: name }));
    const known = { ...POINTS, [ZONE]: ZONES };
    const kind = known[String(given ?? "").toLowerCase()];
    if (!kind) throw new FormatError(t("{feature} has no property `kind` that is {kinds} or {zone}", { feature: name, kinds: Object.keys(POINTS).join(", "), zone: ZONE }));
    const schemas = itemFields(fields, kind);
    const item = {};
    for (const [field, value] of Object.entries(properties)) {
      if (field === "id" || value === null) continue;
      if (field in schemas) item[field] = isAmounts(schemas[field]) || isWords(schemas[field]) ? listOf(value, schemas[field]) : value;
      else foreign.add(field);
    }
    const id = feature.id ?? properties.id;
    if (isName(id)) item.id = String(id);
    const onEarth = ([x, y]) => {
      if (!settings && !(Math.abs(x) <= 180 && Math.abs(y) <= 90)) throw new FormatError(t("{feature} is at {place}: these are no degrees of longitude and latitude", { feature: name, place: `${x}, ${y}` }));
      return [x, y];
    };
    if (kind === ZONES) {
      const polygon = cornersOf(feature.geometry, name);
      // Of a file of this page the service judges them.
      (problem[ZONES] ??= []).push({ ...item, polygon: settings ? polygon : polygon.map((corner) => onEarth(pair(corner, name))) });
      return;
    }
    const [x, y] = onEarth(placeOf(feature.geometry, name, notices, !settings || settings.crs === "wgs84"));
    (problem[kind] ??= []).push(placed(kind, item, x, y));
  });
  if (foreign.size) notices.push(t("Attributes that are no fields of a problem were left out: {attributes}", { attributes: [...foreign].join(", ") }));
  return { problem, notices };
}

/** An item at its place: a UAV that has a position of its own has that there, any other its starting point. */
function placed(kind, item, x, y) {
  if (kind !== "uavs") return { ...item, x, y };
  return { ...item, [item.x_c === undefined ? "x_s" : "x_c"]: x, [item.y_c === undefined ? "y_s" : "y_c"]: y };
}

function isName(value) {
  return ["string", "number"].includes(typeof value);
}

export function nameOf(feature, at) {
  const { id, name, Name, NAME } = feature?.properties ?? {};
  const called = [feature?.id, id, name, Name, NAME].find((each) => isName(each) && each !== "");
  const row = rowText("feature", at + 1);
  return called === undefined ? row : `${row} (${called})`;
}

/** Refuse coordinates that are no degrees of WGS 84; without a `crs` they are (RFC 7946, 4). */
export function onGlobe(crs) {
  const name = crs?.properties?.name ?? crs?.properties?.code ?? crs?.properties?.href;
  if (crs === undefined || crs === null || DEGREES.test(String(name ?? ""))) return;
  throw new FormatError(t("its `crs` is {crs}: save it with longitude and latitude on WGS 84 (EPSG:4326)", { crs: String(name ?? JSON.stringify(crs)) }));
}

/** The corners of a zone, without the last one, which closes the ring. */
function cornersOf({ type, coordinates }, name) {
  if (type !== "Polygon" || !Array.isArray(coordinates?.[0])) throw new FormatError(t("{feature} is a {type}: a zone is one Polygon", { feature: name, type: typeText(type) }));
  const [ring, ...holes] = coordinates;
  if (holes.length) throw new FormatError(tn(holes.length, "{feature} has {count} hole: a zone has none", "{feature} has {count} holes: a zone has none", { feature: name }));
  return ring.length > 1 && same(ring[0], ring.at(-1)) ? ring.slice(0, -1) : ring;
}

/** A list, which some programs save as its text. */
function listOf(value, schema) {
  if (typeof value !== "string") return value;
  if (isWords(schema)) return wordsIn(value) ?? value;
  try {
    return JSON.parse(value);
  } catch {
    return value;
  }
}

/** Where a feature is; of a polygon the middle, which is said. @param {boolean} globe whether its coordinates are degrees */
export function placeOf({ type, coordinates }, name, notices, globe) {
  const parts = Array.isArray(coordinates) ? coordinates : [];
  if (type === "Point") return pair(coordinates, name);
  if (type === "MultiPoint" && parts.length === 1) return pair(parts[0], name);
  if (type === "Polygon" || type === "MultiPolygon") {
    const rings = (type === "Polygon" ? [parts[0]] : parts.map((polygon) => polygon?.[0])).filter((ring) => Array.isArray(ring) && ring.length);
    if (!rings.length) throw new FormatError(t("{feature} is an empty {type}", { feature: name, type }));
    const middles = rings.map((ring) => middleOf(ring.map((place) => pair(place, name)), globe));
    notices.push(t("{feature} is a {type}: its middle was taken", { feature: name, type }));
    return middles.reduce((a, b) => (b.area > a.area ? b : a)).place;
  }
  if (type === "MultiPoint") throw new FormatError(t("{feature} is a MultiPoint of {count} points: a UAV, an area or a base is one point", { feature: name, count: parts.length }));
  throw new FormatError(t("{feature} is a {type}: a UAV, an area or a base is one point", { feature: name, type: typeText(type) }));
}

function typeText(type) {
  return typeof type === "string" ? type : JSON.stringify(type ?? null);
}

function pair(coordinates, name) {
  const [x, y] = Array.isArray(coordinates) ? coordinates : [];
  if (!Number.isFinite(x) || !Number.isFinite(y)) throw new FormatError(t("{feature} has coordinates that are no numbers: {coordinates}", { feature: name, coordinates: String(JSON.stringify(coordinates)) }));
  return [x, y];
}

/** The centroid of a ring and its area; of one without an area the mean of its corners. */
function middleOf(given, globe) {
  const ring = globe ? unrolled(given) : given;
  const [[x0, y0]] = ring;
  let [area, sx, sy] = [0, 0, 0];
  ring.forEach(([ax, ay], at) => {
    const [bx, by] = ring[(at + 1) % ring.length];
    const part = (ax - x0) * (by - y0) - (bx - x0) * (ay - y0);
    area += part;
    sx += part * (ax + bx - 2 * x0);
    sy += part * (ay + by - 2 * y0);
  });
  const mean = (axis) => ring.reduce((sum, corner) => sum + corner[axis], 0) / ring.length;
  const [x, y] = area ? [x0 + sx / (3 * area), y0 + sy / (3 * area)] : [mean(0), mean(1)];
  const place = [globe ? x - 360 * Math.round(x / 360) : x, y];
  return { area: Math.abs(area), place: place.map((value) => Number(value.toFixed(7))) };
}

/** A ring whose sides are the shorter way round: one over the antimeridian goes on beyond 180. */
function unrolled(ring) {
  let before = ring[0][0];
  return ring.map(([x, y]) => {
    before = x + 360 * Math.round((before - x) / 360);
    return [before, y];
  });
}
