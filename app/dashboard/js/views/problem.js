/** The problem: examples, files, settings, what is selected; below the map a table of all UAVs and areas. */

import { json } from "../api.js";
import { download, h, notify, shown } from "../dom.js";
import { Fields, labelled } from "../fields.js";
import { read, toCsv, toGeoJson, toJson } from "../formats.js";
import { Grid } from "../grid.js";
import { edit, materials, open, redo, remove, setMaterials, undo, update } from "../problem.js";
import { rangeLeft, stateOf } from "../plan.js";
import { registerView } from "../registry.js";
import { get, select, subscribe } from "../state.js";

const FILES = { JSON: [toJson, "json", "application/json"], CSV: [toCsv, "csv", "text/csv"], GeoJSON: [toGeoJson, "geojson", "application/geo+json"] };
const OPTIONAL = new Set(["x_c", "y_c", "dis", "ret", "deadline", "service_time"]);
const COLUMNS = {
  uavs: { id: "UAV", x_s: "base x", y_s: "base y", x_c: "now x", y_c: "now y", speed: "speed", voyage: "range", dis: "flown", ret: "returning" },
  targets: { id: "Area", x: "x", y: "y", level: "urgency", deadline: "deadline", service_time: "service time" },
};
const KINDS = { uavs: "UAVs", targets: "Areas" };

function columnsOf(kind, problem) {
  const globe = problem.crs === "wgs84";
  const told = (title) => (globe ? title.replace(/\bx$/, "longitude").replace(/\by$/, "latitude") : title);
  const fields = Object.entries(COLUMNS[kind]).map(([name, title]) => ({ name, title: told(title), read: (item) => item[name] }));
  const loads = Array.from({ length: materials(problem) }, (_, k) => ({
    name: `loadlist/${k}`, title: `${kind === "uavs" ? "load" : "need"} ${k + 1}`, read: (item) => item.loadlist[k],
  }));
  return [...fields, ...loads];
}

/** Take what was typed into a cell or field as the item's. */
function enter(kind, id, name, text) {
  const item = get().problem[kind].find((each) => each.id === id);
  if (name === "id") {
    if (!text || get().problem[kind].some((each) => each.id === text)) return notify(`Another id is needed than “${text}”`, "error");
    return update(kind, id, { id: text });
  }
  const value = text === "" ? undefined : Number(text.replace("−", "-"));
  if (Number.isNaN(value) || (value === undefined && !OPTIONAL.has(name))) return notify(`${name} of ${id} needs a number`, "error");
  const [field, k] = name.split("/");
  update(kind, id, k === undefined ? { [name]: value } : { [field]: item.loadlist.with(Number(k), value) });
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
  dock.append(h("div", { class: "dock-bar" }, Object.values(buttons)), grids.uavs.element, grids.targets.element);
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
      grids[kind].show(problem[kind], columnsOf(kind, problem));
      buttons[kind].textContent = `${KINDS[kind]} ${problem[kind].length}`;
    }
    mark();
  };
  choose("targets");
  subscribe(["problem"], draw);
  subscribe(["selection", "violations"], mark);
  draw();
}

async function fillExamples(root) {
  if (!get().algorithms.length || root.dataset.filled) return;
  root.dataset.filled = "true";
  const { examples } = await json("examples");
  root.prepend(
    ...examples.map(({ name, href }) =>
      h("button", { type: "button", dataset: { example: name }, onclick: async () => open(await json(href), name) }, name),
    ),
  );
}

function mountExamples(root) {
  root.append(h("button", { type: "button", onclick: () => open({ crs: get().problem.crs }, "New problem") }, "Empty"));
  const fill = () => fillExamples(root).catch((error) => notify(error.message, "error"));
  subscribe(["algorithms"], fill);
  fill();
}

async function takeIn(file) {
  try {
    open(read(await file.text(), get().problem), file.name.replace(/\.[^.]+$/, ""));
    notify(`${file.name} is open`);
  } catch (error) {
    notify(`${file.name}: ${error.message}`, "error");
  }
}

function filesCard() {
  const input = h("input", { type: "file", id: "import", accept: ".json,.csv,.geojson", hidden: true, onchange: () => { takeIn(input.files[0]); input.value = ""; } });
  const save = ([make, ending, type]) => download(`${get().problemName || "problem"}.${ending}`, make(get().problem), type);
  return h("div", { class: "row" }, h("button", { type: "button", onclick: () => input.click() }, "Import…"), input,
    Object.entries(FILES).map(([title, file]) => h("button", { type: "button", dataset: { export: title }, onclick: () => save(file) }, title)));
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
  const back = h("button", { type: "button", class: "quiet", title: "Ctrl+Z", onclick: undo }, "Undo");
  const forth = h("button", { type: "button", class: "quiet", title: "Ctrl+Shift+Z", onclick: redo }, "Redo");
  const enable = () => { back.disabled = !get().past.length; forth.disabled = !get().future.length; };
  subscribe(["past", "future"], enable);
  enable();
  return h("div", { class: "row" }, button("uavs", "Place UAVs"), button("targets", "Place areas"), back, forth, h("button", { type: "button", class: "quiet", onclick: () => map.fit() }, "Fit map"));
}

/** Fields of what is selected, each under its own label. */
function mountInspector(root) {
  const draw = () => {
    const { selection, problem } = get();
    const item = selection && problem[selection.kind].find((each) => each.id === selection.id);
    if (!item) return root.replaceChildren(h("p", { class: "hint" }, "Select a UAV or an area on the map or in the table to see and change it."));
    const { kind, id } = selection;
    const at = problem[kind].indexOf(item);
    const fields = columnsOf(kind, problem).map((column) => {
      const value = column.read(item);
      const input = h("input", { value: value === undefined ? "" : String(value), autocomplete: "off", spellcheck: "false", name: column.name, onchange: () => enter(kind, id, column.name, input.value.trim()) });
      return labelled(column.title, input, { pointer: `/${kind}/${at}/${column.name}` });
    });
    const facts = kind === "uavs" ? `${stateOf(item)}, range left ${shown(rangeLeft(item), 6)} of ${shown(item.voyage, 6)}` : "";
    root.replaceChildren(h("div", { class: "card" }, h("div", { class: "row spread" }, h("h2", {}, id), h("button", { type: "button", class: "quiet danger", onclick: () => remove(kind, id) }, "Delete")), facts && h("p", { class: "hint" }, facts), h("div", { class: "grid3" }, fields)));
  };
  subscribe(["selection", "problem"], draw);
  draw();
}

/** Settings of the problem, the objective's from the service's own description. */
async function mountSettings(root) {
  const { components } = await json("openapi.json");
  const objective = components.schemas.ObjectiveModel;
  const draw = () => {
    const { problem } = get();
    const steps = h("input", { value: String(problem.max_steps), inputmode: "numeric", name: "max_steps", onchange: () => edit(() => ({ max_steps: Number(steps.value) })) });
    const kinds = h("input", { value: String(materials(problem)), inputmode: "numeric", name: "materials", onchange: () => (Number(kinds.value) >= 1 && Number(kinds.value) <= 64 ? setMaterials(Math.trunc(Number(kinds.value))) : draw()) });
    const crs = h("select", { name: "crs", onchange: () => edit(() => ({ crs: crs.value })) }, [["local", "on a plane"], ["wgs84", "longitude, latitude"]].map(([value, title]) => h("option", { value, selected: value === problem.crs }, title)));
    const fields = new Fields(objective.properties, { pointer: "/objective", values: problem.objective, defs: components.schemas, onchange: () => edit(() => ({ objective: { distance_weight: null, return_to_base: true, charge_return: false, ...fields.values() } })) });
    root.replaceChildren(h("div", { class: "grid2" }, labelled("Positions", crs, { pointer: "/crs" }), labelled("Decision steps", steps, { pointer: "/max_steps" }), labelled("Kinds of material", kinds, { pointer: "/materials" })), fields.element);
  };
  let known = null;
  const redraw = ({ problem }) => {
    const now = JSON.stringify([problem.max_steps, problem.crs, problem.objective, materials(problem)]);
    if (now === known) return;
    known = now;
    draw();
  };
  subscribe(["problem"], redraw);
  redraw(get());
}

registerView({
  id: "problem", title: "Problem", order: 10, layout: "panel",
  mount(root, { map, dock }) {
    const examples = h("div", { class: "row" });
    const inspector = h("div", {});
    const settings = h("div", { class: "block" });
    root.append(
      h("div", { class: "block" }, h("h2", {}, "Examples"), examples),
      h("div", { class: "block" }, h("h2", {}, "Import and export"), filesCard()),
      h("div", { class: "block" }, h("h2", {}, "Edit"), placing(map), inspector),
      h("details", {}, h("summary", {}, "Settings of the problem"), settings),
    );
    mountTables(dock);
    mountInspector(inspector);
    mountExamples(examples);
    mountSettings(settings).catch((error) => notify(error.message, "error"));
  },
});
