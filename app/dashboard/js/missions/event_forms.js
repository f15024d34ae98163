/** Forms of what can happen in a mission, a function each: its title, its fields, and the event that it makes of them. */

import { fieldTitle } from "../columns.js";
import { h } from "../dom.js";
import { asLabel, Fields, labelled } from "../fields.js";
import { BASES, ZONES } from "../kinds.js";
import { called, sum } from "../plan.js";
import { freeId } from "../problem.js";
import { itemFields } from "../schema.js";
import { get } from "../state.js";
import { t, tn } from "../texts.js";
import { stopsAhead } from "./doing.js";

const SINGLE = new Set(["number", "integer", "boolean", "string"]);
/** Fields of UAVs and areas that the mission itself keeps, or that say what an item is and not how it is. */
const KEPT = new Set(["id", "x_c", "y_c", "dis", "ret", "airborne", "available_from"]);

/** A choice among items, told apart by their ids. */
function choice(title, name, items, chosen) {
  const select = h("select", { name }, items.map((item) => h("option", { value: item.id, selected: item.id === chosen }, item.name ? `${item.name} (${item.id})` : item.id)));
  return { element: labelled(title, select, { pointer: `/${name}` }), read: () => select.value, select };
}

function number(title, name, value) {
  const input = h("input", { type: "number", step: "any", name, value: value === undefined ? "" : String(value) });
  return { element: labelled(title, input, { pointer: `/${name}` }), read: () => (input.value === "" ? undefined : Number(input.value)) };
}

/** An amount a material. */
function amounts(title, pointer, values, problem) {
  const inputs = values.map((value, k) => h("input", { type: "number", step: "any", min: "0", name: `${pointer.slice(1)}/${k}`, value: String(Number(value.toPrecision(12))) }));
  const nameOf = (k) => problem.materials?.[k]?.name ?? t("material {number}", { number: k + 1 });
  const element = h("div", { class: "grid3" }, inputs.map((input, k) => labelled(values.length === 1 ? title : `${title}, ${nameOf(k)}`, input, { pointer: `${pointer}/${k}` })));
  return { element, read: () => inputs.map((input) => Number(input.value)), fill: (given) => given.forEach((amount, k) => { inputs[k].value = String(Number(amount.toPrecision(12))); }) };
}

/** All single fields of an item, with what it has; what the forms have no field for stays as it is. */
function itemForm(list, item, pointer, problem, needs) {
  const schemas = Object.fromEntries(Object.entries(itemFields(get().fields, list)).filter(([name, schema]) => SINGLE.has(schema.type) && !KEPT.has(name)));
  const globe = problem.crs === "wgs84";
  const titles = Object.fromEntries(Object.keys(schemas).map((name) => [name, asLabel(fieldTitle(list, name, globe))]));
  const fields = new Fields(schemas, { pointer, values: item, titles, globe });
  const load = amounts(needs, `${pointer}/loadlist`, item.loadlist, problem);
  const [plain, further] = [fields.fields.filter(({ name }) => item[name] !== undefined || schemas[name].needed), fields.fields.filter(({ name }) => item[name] === undefined && !schemas[name].needed)];
  const element = h("div", { class: "block" }, load.element, plain.map((field) => field.element), h("details", {}, h("summary", {}, t("Further fields")), h("div", { class: "fields" }, further.map((field) => field.element))));
  const read = () => {
    // What a form leaves out is the field's default.
    const { ...kept } = item;
    for (const name of Object.keys(schemas)) delete kept[name];
    return { ...kept, ...fields.values(), loadlist: load.read() };
  };
  return { element, read };
}

function areaForm(problem, item, at) {
  return itemForm("targets", item, `/targets/${at}`, problem, t("Still needed"));
}

/** The visit of a UAV, or to an area, that is most likely meant: the newest that was not reported, or the next of the plan. */
function visitOf({ state, plan }, uavId, targetId) {
  const fits = (uav, target) => target !== undefined && (uavId === undefined || uav === uavId) && (targetId === undefined || target === targetId);
  const done = state.done.findLast((each) => !each.reported && fits(each.uav_id, each.target_id));
  if (done) return done;
  const ahead = stopsAhead(state.problem, plan).find(({ uav, stop }) => fits(uav.id, stop.target_id));
  return ahead ? { uav_id: ahead.uav.id, target_id: ahead.stop.target_id, amounts: ahead.stop.delivered } : null;
}

function visitDone(given, moment) {
  const { problem } = moment.state;
  const planned = given.amounts ? given : (visitOf(moment, given.uav_id, given.target_id) ?? given);
  const uav = choice(t("UAV"), "uav_id", problem.uavs, planned.uav_id);
  const area = choice(t("Area"), "target_id", problem.targets, planned.target_id);
  const unloaded = amounts(t("Unloaded"), "/delivered", planned.amounts ?? problem.targets[0].loadlist.map(() => 0), problem);
  const refill = () => {
    const known = visitOf(moment, uav.read(), area.read());
    if (known) unloaded.fill(known.amounts);
  };
  for (const { select } of [uav, area]) select.addEventListener("change", refill);
  return { title: t("A visit is done"), parts: [uav, area, unloaded], read: () => ({ type: "visit_done", uav_id: uav.read(), target_id: area.read(), delivered: unloaded.read() }) };
}

function reloadDone(given, { state: { problem, done } }) {
  const uav = choice(t("UAV"), "uav_id", problem.uavs, given.uav_id);
  const base = choice(t("Base"), "base_id", problem[BASES], given.base_id ?? done.findLast((each) => each.base_id && each.uav_id === given.uav_id)?.base_id);
  const aboard = (id) => { const of = problem.uavs.find((each) => each.id === id); return given.amounts ?? (of.full_load && !sum(of.loadlist) ? of.full_load : of.loadlist); };
  const load = amounts(t("Aboard now"), "/loadlist", aboard(uav.read()), problem);
  uav.select.addEventListener("change", () => load.fill(aboard(uav.read())));
  return { title: t("A reload is done"), parts: [uav, base, load], read: () => ({ type: "reload_done", uav_id: uav.read(), base_id: base.read(), loadlist: load.read() }) };
}

function uavDelayed({ uav_id: id }, { state: { clock } }) {
  const until = number(t("Until"), "until", Number((clock + 0.25).toPrecision(6)));
  return { title: t("{uav} is delayed", { uav: id }), parts: [until], read: () => ({ type: "uav_delayed", uav_id: id, until: until.read() }) };
}

function uavLost({ uav_id: id }) {
  return { title: t("{uav} is lost", { uav: id }), says: t("It makes no more visits, and what is aboard does not arrive."), danger: true, parts: [], read: () => ({ type: "uav_lost", uav_id: id }) };
}

function levelChanged({ target_id: id }, { state: { problem } }) {
  const level = number(t("Urgency"), "level", problem.targets.find((each) => each.id === id).level);
  return { title: t("Urgency of {area}", { area: id }), parts: [level], read: () => ({ type: "level_changed", target_id: id, level: level.read() }) };
}

function areasChanged({ target_id: id }, { state: { problem } }) {
  const before = problem.targets.find((each) => each.id === id);
  const form = areaForm(problem, before, 0);
  const read = () => {
    // What it asked for is what it needs and what it got: the service adds that.
    const { requested: _, ...now } = form.read();
    return { type: "areas_changed", targets: [now] };
  };
  return { title: t("{area}: need or place changed", { area: called(before) }), says: t("What it needs is what it needs still, beside what it has got."), parts: [form], read };
}

function areaCancelled({ target_id: id }) {
  return { title: t("{area} is cancelled", { area: id }), says: t("It needs nothing any more."), danger: true, parts: [], read: () => ({ type: "area_cancelled", target_id: id }) };
}

function areasAdded({ x, y }, { state: { problem } }) {
  const like = problem.targets.at(-1);
  const most = problem.targets.reduce((needs, target) => needs.map((need, k) => Math.max(need, target.loadlist[k])), like.loadlist);
  const item = { id: freeId("targets", problem.targets), x, y, level: Math.max(...problem.targets.map((target) => target.level)), loadlist: most, service_time: like.service_time };
  const form = areaForm(problem, item, 0);
  const id = text(t("Id"), "id", item.id, "/targets/0/id");
  return { title: t("An area is found"), parts: [id, form], read: () => ({ type: "areas_added", targets: [{ ...form.read(), id: id.read() }] }) };
}

function uavsAdded({ x, y }, { state: { problem } }) {
  const like = problem.uavs[0];
  const { x_c: _x, y_c: _y, dis: _d, ret: _r, airborne: _a, available_from: _f, committed: _c, name: _n, full_load: full, ...rest } = like;
  const item = { ...rest, id: freeId("uavs", problem.uavs), x_s: x, y_s: y, loadlist: full ?? like.loadlist };
  const form = itemForm("uavs", item, "/uavs/0", problem, t("Aboard"));
  const id = text(t("Id"), "id", item.id, "/uavs/0/id");
  return { title: t("A UAV is added"), parts: [id, form], read: () => ({ type: "uavs_added", uavs: [{ ...form.read(), id: id.read() }] }) };
}

function text(title, name, value, pointer) {
  const input = h("input", { name, value, autocomplete: "off", spellcheck: "false" });
  return { element: labelled(title, input, { pointer }), read: () => input.value.trim() };
}

function stockChanged({ base_id: id }, { state: { problem } }) {
  const base = problem[BASES].find((each) => each.id === id);
  const stock = amounts(t("In stock"), "/stock", base.stock ?? problem.targets[0].loadlist.map(() => 0), problem);
  return { title: t("Stock of {base}", { base: called(base) }), parts: [stock], read: () => ({ type: "stock_changed", base_id: id, stock: stock.read() }) };
}

function zonesChanged({ polygon, without, shapes }) {
  if (shapes) return { title: t("Zones have another shape"), says: t("It counts once it is told."), parts: [shapes], read: () => ({ type: "zones_changed", no_fly_zones: shapes.read() }) };
  // All zones are told: those that there are when it is told, as others may have changed them since it was opened.
  const now = () => {
    const zones = get().openMission.head.state.problem[ZONES] ?? [];
    return without ? zones.filter(({ id }) => id !== without) : [...zones, { id: freeId(ZONES, zones), polygon }];
  };
  const says = without ? t("It may be flown through again.") : tn(polygon.length, "It has {count} corner.", "It has {count} corners.");
  return { title: without ? t("{zone} is open again", { zone: without }) : t("A zone is closed"), says, parts: [], read: () => ({ type: "zones_changed", no_fly_zones: now() }) };
}

function windChanged(_, { state: { problem } }) {
  const title = problem.crs === "wgs84" ? t("Speed, km/h (empty: still air)") : t("Speed (empty: still air)");
  const speed = number(title, "wind/speed", problem.wind?.speed);
  const towards = number(t("Towards, ° from north"), "wind/towards", problem.wind?.towards);
  const read = () => ({ type: "wind_changed", wind: speed.read() === undefined ? null : { ...(problem.wind ?? {}), speed: speed.read(), towards: towards.read() ?? 0 } });
  return { title: t("The wind is another"), parts: [speed, towards], read };
}

/** What can happen, by the type of its event; each is given what was clicked, and `{state, plan}` of the moment. */
export const FORMS = {
  visit_done: visitDone, reload_done: reloadDone, uav_delayed: uavDelayed, uav_lost: uavLost, level_changed: levelChanged,
  areas_changed: areasChanged, area_cancelled: areaCancelled, areas_added: areasAdded, uavs_added: uavsAdded,
  stock_changed: stockChanged, zones_changed: zonesChanged, wind_changed: windChanged,
};
