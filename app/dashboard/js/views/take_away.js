/** Plans to take away: flight files, GeoJSON, a table, a page to print. */

import { address, hasKey, send } from "../api.js";
import { download, h, notify } from "../dom.js";
import { names } from "../plan.js";
import { outOfDate, staleNote } from "../plan_notes.js";
import { registerView } from "../registry.js";
import { get, subscribe } from "../state.js";
import { t, tn } from "../texts.js";
import { beginOnTheWall } from "../units.js";

const DELIVERIES = [
  ["payload-place", t("Place the payload (NAV_PAYLOAD_PLACE)")],
  ["servo", t("Move a servo (DO_SET_SERVO)")],
  ["gripper", t("Open a gripper (DO_GRIPPER)")],
  ["land", t("Land and take off again")],
  ["none", t("Only fly there")],
];
const FILES = [
  ["qgc-plan", t("QGroundControl .plan")],
  ["qgc-wpl", t("Waypoints, QGC WPL 110")],
  ["briefing", t("Briefing: times, altitudes, warnings")],
  ["kml", t("Map, KML")],
  ["gpx", t("Routes, GPX")],
];
const DOCUMENTS = [
  ["geojson", t("GeoJSON of the whole plan")],
  ["csv", t("Table of all stops, CSV")],
  ["load-sheet", t("Load sheet, CSV")],
  ["html", t("Page to print, saved")],
];

const ASK = t("The problem was changed after this plan. Save the plan as it was made?");

/** Of a printed page, as the service takes it. */
const LONGEST_TITLE = 200;

let parts = null;

registerView({ id: "take-away", title: t("Take away"), order: 70, layout: "panel", mount, show: draw });

function mount(root) {
  const choice = (name, options) =>
    h("select", { name, onchange: draw }, options.map(([value, text]) => h("option", { value }, text)));
  const figure = (name, value, min, max, step = "any") => h("input", { name, type: "number", value, min, max, step, required: true });
  parts = {
    uav: h("select", { name: "uav" }),
    rows: new Map(),
    form: h("form", { class: "take", onsubmit: (event) => event.preventDefault() }),
    state: h("p", { class: "muted", role: "status", "data-testid": "take-status" }),
    flight: h("div", { class: "files" }, FILES.map(([format, text]) =>
      h("button", { type: "button", class: "primary", dataset: { format }, onclick: () => void take(format) }, text))),
    documents: h("div", { class: "files" },
      DOCUMENTS.map(([format, text]) =>
        h("button", { type: "button", dataset: { format }, onclick: () => void take(format) }, text)),
      h("a", { class: "button", target: "_blank", rel: "noopener", "data-testid": "print", onclick: (event) => { if (outOfDate() && !confirm(ASK)) event.preventDefault(); } }, t("Open the page to print"))),
  };
  const row = (text, control, only = null) => {
    const made = h("label", { class: "line" }, h("span", {}, text), control, h("span", { class: "error", role: "alert" }));
    parts.rows.set(control.name, { made, control, only });
    return made;
  };
  parts.form.append(
    row(t("UAV"), parts.uav),
    row(t("Altitude, m"), figure("altitude", "50", "1", "10000")),
    row(t("Between UAVs of one place, m"), figure("altitude_step", "10", "0", "500")),
    row(t("Measured from"), choice("altitude_reference", [["", t("the start, or the ground below on long flights")], ["home", t("the starting point")], ["terrain", t("the ground below")]])),
    row(t("Between launches, s"), figure("launch_interval", "60", "0", "3600")),
    row(t("Delivery"), choice("delivery", DELIVERIES)),
    row(t("It may descend, m (0: no limit)"), figure("max_descent", "0", "0", "1000"), "payload-place"),
    row(t("Servo output"), figure("servo_channel", "9", "1", "32", "1"), "servo"),
    row(t("Pulse width, µs"), figure("servo_pwm", "1900", "500", "2500", "1"), "servo"),
    row(t("Gripper"), figure("gripper", "1", "1", "8", "1"), "gripper"),
    row(t("After the last stop"), choice("end", [["return", t("return, or go to its base")], ["land", t("land there")]])));
  root.append(
    h("h2", {}, t("Take it away")),
    staleNote("stale-export", t("The problem was changed after this plan: what is saved here goes where the plan was made for. Allocate again first, or undo the change.")),
    parts.state,
    h("section", { class: "card" }, h("h3", {}, t("Flight files")), parts.form, parts.flight),
    h("section", { class: "card" }, h("h3", {}, t("The whole plan")), parts.documents));
  subscribe(["answer", "answerProblem", "begins", "opened", "problemName"], draw);
  draw();
}

function draw() {
  const { answer, answerProblem } = get();
  const delivery = parts.rows.get("delivery").control.value;
  for (const { made, only } of parts.rows.values()) made.hidden = only !== null && only !== delivery;
  const kept = parts.uav.value;
  const flying = answer ? answer.routes.filter((route) => route.stops.length || route.return_distance > 0) : [];
  const nameOf = names(answerProblem?.uavs ?? []);
  parts.uav.replaceChildren(
    h("option", { value: "" }, tn(flying.length, "the {count} that flies (ZIP)", "all {count} that fly (ZIP)")),
    ...flying.map((route) => h("option", { value: route.uav_id }, nameOf(route.uav_id))));
  if (flying.some((route) => route.uav_id === kept)) parts.uav.value = kept;
  const geographic = answerProblem?.crs === "wgs84";
  for (const button of parts.flight.children) button.disabled = !answer || !geographic;
  for (const button of parts.documents.querySelectorAll("button")) button.disabled = !answer;
  const link = parts.documents.querySelector("a");
  // A new tab has no key to ask with.
  link.hidden = !answer || hasKey();
  if (answer) link.href = address(`jobs/${answer.job_id}/plan?${new URLSearchParams({ format: "html", ...heading() })}`);
  parts.state.textContent = !answer
    ? t("Allocate first: there is no plan yet.")
    : geographic
      ? t("{flying} of {uavs} UAVs fly in this plan.", { flying: flying.length, uavs: answer.routes.length })
      : t("This problem's crs is local; flight files need wgs84 (longitudes and latitudes). The other files have the local x and y.");
}

/** What stands above a printed page: what the problem is called, and when the plan begins. */
function heading() {
  const title = get().problemName.slice(0, LONGEST_TITLE);
  const begins = beginOnTheWall();
  return { ...(title ? { title } : {}), ...(begins ? { begins } : {}) };
}

async function take(format) {
  if (outOfDate() && !confirm(ASK)) return;
  const { answer } = get();
  const asked = new URLSearchParams({ format, ...(format === "html" ? heading() : {}) });
  const flight = FILES.some(([name]) => name === format);
  for (const { control, made } of parts.rows.values()) {
    made.querySelector(".error").textContent = "";
    if (flight && !made.hidden && control.value !== "") asked.set(control.name, control.value);
  }
  try {
    const response = await send(`jobs/${answer.job_id}/plan?${asked}`);
    const name = /filename="([^"]+)"/.exec(response.headers.get("Content-Disposition") ?? "")?.[1] ?? `plan.${format}`;
    download(name, await response.blob());
    parts.state.textContent = t("{file} was checked and saved.", { file: name });
  } catch (error) {
    for (const { parameter, detail } of error.violations ?? []) {
      const row = parts.rows.get(parameter);
      if (row) row.made.querySelector(".error").textContent = detail;
    }
    parts.state.textContent = error.message;
    notify(error.message, "error");
  }
}
