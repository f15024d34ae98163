/** The problem: examples, files, settings, what is selected; below the map a table of all UAVs and areas. */

import { running } from "../allocation.js";
import { json } from "../api.js";
import { amountTitle, columnTitle, fieldTitle } from "../columns.js";
import { download, h, notify } from "../dom.js";
import { Fields, inLine, labelled, labelOf } from "../fields.js";
import { toCsv, toGeoJson, toJson } from "../formats.js";
import { fleetForm, moreLike } from "../fleet_form.js";
import { Grid } from "../grid.js";
import { redo, undo } from "../history.js";
import { templateOf } from "../import_dialog.js";
import { bring, NOT_SAID, said, takeFile } from "../intake.js";
import { BASES, ZONES } from "../kinds.js";
import { beyond, onEarth } from "../limits.js";
import { materialNames } from "../materials.js";
import { edit, materials, nameMaterial, remove, setMaterials, update } from "../problem.js";
import { rangeLeft, stateText } from "../plan.js";
import { registerView } from "../registry.js";
import { amountsOf, isAmounts, isFlag, isWords, itemFields } from "../schema.js";
import { get, select, set, subscribe } from "../state.js";
import { plainNumber, shown, t, writtenNumber } from "../texts.js";
import { wordsIn, writtenWords } from "../words.js";
import { cornersOf, drawingControls } from "../zone_form.js";
import { planNow } from "./allocate.js";

const FILES = { JSON: [toJson, "json", "application/json"], CSV: [toCsv, "csv", "text/csv"], GeoJSON: [toGeoJson, "geojson", "application/geo+json"] };
const KINDS = { uavs: t("UAVs"), targets: t("Areas"), [BASES]: t("Bases"), [ZONES]: t("Zones") };
/** Types of settings that have one value, and so one form field. */
const SINGLE = ["number", "integer", "boolean", "string"];
const PLACES = { local: t("on a plane"), wgs84: t("longitude, latitude") };
/** Fields of UAVs that have left: where one is now, and what of its flight is behind it. */
const IN_FLIGHT = new Set(["x_c", "y_c", "dis", "airborne"]);
/** Tables to fill in, by what they are of. */
const TEMPLATES = { targets: t("Template: areas"), uavs: t("Template: UAVs"), [BASES]: t("Template: bases") };

/** Columns of numbers, words and texts, and of amounts one a material where an item has some. */
function columnsOf(kind, problem) {
  const globe = problem.crs === "wgs84";
  const names = materialNames(problem);
  const known = get().fields ? itemFields(get().fields, kind) : {};
  const plain = ([, schema]) => ["number", "integer", "string"].includes(schema.type) || isWords(schema);
  // Without a stock a base has as much as is asked for, so that there is always a place to write one.
  const held = ([name, schema]) => isAmounts(schema) && problem[kind]?.some((item) => kind === BASES || item[name]);
  const shownAs = (value, schema) => (value && isWords(schema) ? writtenWords(value) : value);
  const scalars = Object.entries(known).filter(plain).map(([name, schema]) => ({
    name, title: fieldTitle(kind, name, globe), text: schema.type === "string" || isWords(schema), flag: isFlag(schema), read: (item) => shownAs(item[name], schema),
  }));
  const lists = Object.entries(known).filter(held).flatMap(([field]) => Array.from({ length: materials(problem) }, (_, k) => ({
    name: `${field}/${k}`, title: amountTitle(kind, field, k, globe, names), read: (item) => item[field]?.[k],
  })));
  return [...scalars, ...lists];
}

/** The columns of a table: what belongs to a flight is there once a UAV has left. */
function tableColumns(kind, problem) {
  const columns = columnsOf(kind, problem);
  return kind === "uavs" && !problem.uavs.some(hasLeft) ? columns.filter(({ name }) => !IN_FLIGHT.has(name)) : columns;
}

function hasLeft(uav) {
  return [...IN_FLIGHT].some((name) => uav[name]);
}

/** What people call a column of a table of a problem. */
function titleIn(problem, kind, name) {
  return columnTitle(kind, name, problem.crs === "wgs84", materialNames(problem));
}

/** Take what was typed into a cell or field as the item's. */
function enter(kind, id, name, text) {
  const item = get().problem[kind].find((each) => each.id === id);
  if (name === "id") {
    if (!text || get().problem[kind].some((each) => each.id === text)) return notify(t("Another id is needed than “{id}”", { id: text }), "error");
    return update(kind, id, { id: text });
  }
  const schema = itemFields(get().fields, kind)[name];
  if (schema && isWords(schema)) {
    const words = text === "" ? undefined : wordsIn(text);
    return words === null ? notify(t("{field} of {item} needs words with semicolons between", { field: titleIn(get().problem, kind, name), item: id }), "error") : update(kind, id, { [name]: words });
  }
  if (schema?.type === "string") return update(kind, id, { [name]: text || undefined });
  const [field, k] = name.split("/");
  const value = text === "" ? undefined : Number(text.replace("−", "-"));
  if (Number.isNaN(value) || (value === undefined && itemFields(get().fields, kind)[field].needed)) return notify(t("{field} of {item} needs a number", { field: titleIn(get().problem, kind, name), item: id }), "error");
  if (k === undefined || value === undefined) update(kind, id, { [field]: value });
  else {
    // Amounts that were not set are those of the load until then; a base has none.
    const before = item[field] ?? item.loadlist ?? new Array(materials(get().problem)).fill(0);
    update(kind, id, { [field]: before.with(Number(k), value) });
  }
  markBeyond(kind, id);
}

/** Mark the numbers of an item that are beyond their limits; the service judges all else. */
function markBeyond(kind, id) {
  const { problem, fields } = get();
  const at = problem[kind].findIndex((each) => each.id === id);
  const globe = problem.crs === "wgs84";
  const limit = (name, value, schema) => ({ pointer: `/${kind}/${at}/${name}`, detail: Number.isFinite(value) ? beyond(value, onEarth(name, schema, globe)) : null });
  const found = Object.entries(itemFields(fields, kind)).flatMap(([name, schema]) =>
    isAmounts(schema) ? (problem[kind][at][name] ?? []).map((value, k) => limit(`${name}/${k}`, value, schema.items)) : [limit(name, problem[kind][at][name], schema)]);
  const violations = found.filter(({ detail }) => detail);
  if (violations.length) set({ violations });
}

function mountTables(dock) {
  const grids = {};
  for (const kind of Object.keys(KINDS)) {
    grids[kind] = new Grid({
      label: KINDS[kind], kind,
      onEdit: (id, column, text) => enter(kind, id, column.name, text),
      onSelect: (id) => select(id ? { kind, id } : null),
      onDelete: (id) => remove(kind, id),
    });
  }
  const choose = (kind) => {
    for (const each of Object.keys(KINDS)) {
      grids[each].element.hidden = each !== kind;
      buttons[each].setAttribute("aria-pressed", String(each === kind));
    }
  };
  const buttons = Object.fromEntries(Object.entries(KINDS).map(([kind]) => [kind, h("button", { type: "button", class: "quiet", dataset: { table: kind }, onclick: () => choose(kind) })]));
  dock.append(h("div", { class: "dock-bar" }, Object.values(buttons)), ...Object.values(grids).map(({ element }) => element));
  const faults = (kind) =>
    new Map(get().violations.filter((v) => v.pointer.startsWith(`/${kind}/`)).map((v) => [v.pointer.slice(kind.length + 2), v.detail]));
  const mark = () => {
    const { selection } = get();
    for (const kind of Object.keys(KINDS)) grids[kind].mark(selection?.kind === kind ? selection.id : null, faults(kind));
    if (selection) {
      choose(selection.kind);
      grids[selection.kind].reveal(selection.id);
    }
  };
  const draw = () => {
    const { problem } = get();
    for (const kind of Object.keys(KINDS)) {
      const items = problem[kind] ?? [];
      grids[kind].show(items, tableColumns(kind, problem));
      buttons[kind].textContent = `${KINDS[kind]} ${items.length}`;
    }
    mark();
  };
  choose("targets");
  subscribe(["problem", "fields"], draw);
  subscribe(["selection", "violations"], mark);
  draw();
}

async function fillExamples(root) {
  if (!get().algorithms.length || root.dataset.filled) return;
  const { examples } = await json("examples");
  if (root.dataset.filled) return;
  root.dataset.filled = "true";
  root.prepend(
    ...examples.map(({ name, href }) =>
      h("button", { type: "button", dataset: { example: name }, onclick: () => said(async () => bring(await json(href), name)) }, name),
    ),
  );
}

function mountExamples(root) {
  root.append(h("button", { type: "button", onclick: () => bring({ crs: get().problem.crs }, t("New problem"), t("All is taken away")) }, t("Empty")));
  const fill = () => said(() => fillExamples(root));
  subscribe(["algorithms"], fill);
  fill();
}

function filesCard() {
  const input = h("input", { type: "file", id: "import", accept: ".json,.csv,.tsv,.txt,.geojson", hidden: true, onchange: () => { void takeFile(input.files[0]); input.value = ""; } });
  const save = ([make, ending, type]) => said(() => {
    const { problem, problemName, fields } = get();
    if (!fields) throw new Error(NOT_SAID);
    download(`${problemName || "problem"}.${ending}`, make(problem, fields), type);
  });
  return [
    h("div", { class: "row" }, h("button", { type: "button", onclick: () => input.click() }, t("Import…")), input,
      Object.entries(FILES).map(([title, file]) => h("button", { type: "button", dataset: { export: title }, onclick: () => save(file) }, title))),
    h("p", { class: "hint" }, t("A problem, or a list of places with whatever columns. A file can be dropped anywhere, a table pasted with Ctrl+V.")),
    h("div", { class: "row" }, Object.entries(TEMPLATES).map(([kind, title]) => h("button", { type: "button", class: "quiet", dataset: { template: kind }, onclick: () => download(`${kind}.csv`, templateOf(kind), "text/csv") }, title))),
  ];
}

/** The way from a problem to its plan. */
function planning() {
  const plan = h("button", { type: "button", class: "primary", id: "plan", title: "Ctrl+Enter", onclick: planNow }, t("Plan"));
  const enable = () => { plan.disabled = running(get().job); };
  subscribe(["job"], enable);
  enable();
  return h("div", { class: "row" }, plan, h("p", { class: "hint" }, t("Finds who flies where, with what.")));
}

function placing(map) {
  const button = (kind, title) => {
    const made = h("button", {
      type: "button", "aria-pressed": "false", dataset: { place: kind },
      onclick: () => {
        if (made.getAttribute("aria-pressed") === "true") return map.stopPlacing();
        map.startPlacing(kind, () => made.setAttribute("aria-pressed", "false"));
        made.setAttribute("aria-pressed", "true");
      },
    }, title);
    return made;
  };
  const back = h("button", { type: "button", class: "quiet", title: "Ctrl+Z", onclick: undo }, t("Undo"));
  const forth = h("button", { type: "button", class: "quiet", title: "Ctrl+Shift+Z", onclick: redo }, t("Redo"));
  const enable = () => { back.disabled = !get().past.length; forth.disabled = !get().future.length; };
  subscribe(["past", "future"], enable);
  enable();
  const zone = drawingControls(map);
  const row = h("div", { class: "row" }, button("uavs", t("Place UAVs")), button("targets", t("Place areas")), button(BASES, t("Place bases")), zone.button, back, forth, h("button", { type: "button", class: "quiet", onclick: () => map.fit() }, t("Fit map")));
  return [row, zone.steps];
}

/** Fields of what is selected, each under its own label. */
function mountInspector(root) {
  const draw = () => {
    const { selection, problem } = get();
    const item = selection && problem[selection.kind]?.find((each) => each.id === selection.id);
    if (!item) return root.replaceChildren(h("p", { class: "hint" }, t("Select a UAV, an area, a base or a zone on the map or in the table to see and change it.")));
    const { kind, id } = selection;
    const at = problem[kind].indexOf(item);
    const field = (column) => {
      const value = column.read(item);
      const pointer = `/${kind}/${at}/${column.name}`;
      if (column.flag) {
        const box = h("input", { type: "checkbox", checked: Boolean(value), name: column.name, onchange: () => enter(kind, id, column.name, box.checked ? "1" : "") });
        return labelled(column.title, box, { pointer });
      }
      const input = h("input", { value: value === undefined ? "" : column.text ? value : writtenNumber(value), autocomplete: "off", spellcheck: "false", name: column.name, onchange: () => enter(kind, id, column.name, column.text ? input.value.trim() : plainNumber(input.value.trim())) });
      return labelled(column.title, input, { pointer });
    };
    const ofFlight = ({ name }) => kind === "uavs" && IN_FLIGHT.has(name);
    const columns = columnsOf(kind, problem);
    const fields = columns.filter((column) => !ofFlight(column)).map(field);
    const flight = columns.filter(ofFlight);
    const inFlight = flight.length > 0 && h("details", { open: hasLeft(item), dataset: { part: "flight" } }, h("summary", {}, t("In flight: where it is now, and what is flown")), h("div", { class: "grid3" }, flight.map(field)));
    const facts = kind === "uavs" ? t("{state}, range left {left} of {range}", { state: stateText(item), left: shown(rangeLeft(item), 6), range: shown(item.voyage, 6) }) : "";
    root.replaceChildren(h("div", { class: "card" }, h("div", { class: "row spread" }, h("h2", {}, id), h("button", { type: "button", class: "quiet danger", onclick: () => remove(kind, id) }, t("Delete"))), facts && h("p", { class: "hint" }, facts), kind === "uavs" && moreLike(item), h("div", { class: "grid3" }, fields), inFlight, kind === ZONES && cornersOf(item, problem)));
  };
  subscribe(["selection", "problem", "fields"], draw);
  draw();
}

/** A field a kind of material for its name. */
function materialNaming(problem, fields) {
  const { maxLength } = itemFields(fields, "materials").name;
  const field = (k) => {
    const input = h("input", { name: `materials/${k}/name`, value: problem.materials?.[k]?.name ?? "", maxlength: String(maxLength), autocomplete: "off", spellcheck: "false", onchange: () => nameMaterial(k, input.value.trim()) });
    return labelled(t("Name of material {number}", { number: k + 1 }), input, { pointer: `/materials/${k}/name` });
  };
  return h("div", { class: "grid3", dataset: { part: "materials" } }, Array.from({ length: materials(problem) }, (_, k) => field(k)));
}

/** Settings of the problem, from the service's own description. */
function mountSettings(root) {
  const numeric = (name, value, take) => h("input", { value: String(value), inputmode: "numeric", name, onchange: (event) => take(Number(event.target.value)) });
  const draw = () => {
    const { problem, fields } = get();
    const { crs, max_steps: steps, ...others } = fields.settings;
    const globe = problem.crs === "wgs84";
    const mostKinds = Math.min(...amountsOf(fields.uavs).map((name) => fields.uavs[name].maxItems));
    const most = numeric("max_steps", problem.max_steps ?? steps.default, (count) => (Number.isInteger(count) ? edit(() => ({ max_steps: count })) : draw()));
    const kinds = numeric("materials", materials(problem), (count) => (count >= 1 && count <= mostKinds ? setMaterials(Math.trunc(count)) : draw()));
    const where = h("select", { name: "crs", onchange: () => edit(() => ({ crs: where.value })) }, crs.enum.map((value) => h("option", { value, selected: value === (problem.crs ?? crs.default) }, PLACES[value] ?? value)));
    const single = Object.fromEntries(Object.entries(others).filter(([, { type, enum: words }]) => words || SINGLE.includes(type)));
    const further = new Fields(single, { pointer: "", values: problem, globe, onchange: () => edit(() => ({ ...Object.fromEntries(Object.keys(single).map((name) => [name, undefined])), ...further.values() })) });
    const own = Object.entries(others).filter(([, { properties }]) => properties).map(([name, { properties, nullable }]) => {
      // What may be left out is not there while nothing of it is filled in.
      const taken = (values) => (nullable && !Object.keys(values).length ? undefined : values);
      const titles = nullable ? Object.fromEntries(Object.keys(properties).map((inner) => [inner, t("{object} {field}", { object: labelOf(name), field: inLine(labelOf(inner)) })])) : {};
      const form = new Fields(properties, { pointer: `/${name}`, values: problem[name], titles, globe, onchange: () => edit(() => ({ [name]: taken(form.values()) })) });
      return form.element;
    });
    root.replaceChildren(h("div", { class: "grid2" }, labelled(t("Positions"), where, { pointer: "/crs" }), labelled(t("Decision steps"), most, { pointer: "/max_steps" }), labelled(t("Kinds of material"), kinds, { pointer: "/materials" })), materialNaming(problem, fields), ...(further.fields.length ? [further.element] : []), ...own);
  };
  let known = null;
  const redraw = ({ problem, fields }) => {
    if (!fields) return;
    const { uavs: _u, targets: _t, ...now } = problem;
    const text = JSON.stringify([now, materials(problem)]);
    if (text === known) return;
    known = text;
    draw();
  };
  subscribe(["problem", "fields"], redraw);
  redraw(get());
}

registerView({
  id: "problem", title: t("Problem"), order: 10, layout: "panel",
  mount(root, { map, dock }) {
    const examples = h("div", { class: "row" });
    const inspector = h("div", {});
    const settings = h("div", { class: "block" });
    root.append(
      planning(),
      h("div", { class: "block" }, h("h2", {}, t("Examples")), examples),
      h("div", { class: "block" }, h("h2", {}, t("Import and export")), ...filesCard()),
      h("div", { class: "block" }, h("h2", {}, t("Edit")), ...placing(map), fleetForm(map), inspector),
      h("details", {}, h("summary", {}, t("Settings of the problem")), settings),
    );
    mountTables(dock);
    mountInspector(inspector);
    mountExamples(examples);
    mountSettings(settings);
  },
});
