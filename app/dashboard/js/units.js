/** Times, durations and lengths of a problem for people: hours and kilometres on the globe, plain numbers on a plane. */

import { h } from "./dom.js";
import { get } from "./state.js";
import { shown, t } from "./texts.js";

const HOUR_MS = 3_600_000;
const MINUTES = [1, 2, 5, 10, 15, 30, 60, 120, 180, 360, 720, 1440, 2880, 10080];
const MOST_TICKS = 8;

/** Whether a problem's times are hours, and its lengths kilometres. */
function onGlobe(problem) {
  return problem.crs === "wgs84";
}

/** When the plan on screen begins, in ms; null where that is not known, its times are no hours, or the problem is a mission's. */
function begin(problem) {
  const { problem: present, answerProblem } = get();
  const begins = beginOnTheWall();
  return begins && onGlobe(problem) && [present, answerProblem].includes(problem) ? new Date(begins).getTime() : null;
}

/** The same as it was entered, `2026-03-01T07:30` in the time of this place; it holds for the problem that it was entered for. */
export function beginOnTheWall({ begins, opened } = get()) {
  return begins?.opened === opened ? begins.at : null;
}

function hoursAndMinutes(hours) {
  const minutes = Math.round(Math.abs(hours) * 60);
  return `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}`;
}

/** A moment since the begin: `+1:42`; a number on a plane. */
function since(problem, time) {
  return onGlobe(problem) ? `${time < 0 ? "−" : "+"}${hoursAndMinutes(time)}` : shown(time);
}

/** A moment of the day, `14:42`; on a later day with the number of days. */
function ofTheDay(from, time) {
  const minute = 60_000;
  const at = new Date(Math.round((from + time * HOUR_MS) / minute) * minute);
  const midnight = (date) => Date.UTC(date.getFullYear(), date.getMonth(), date.getDate());
  const days = Math.round((midnight(at) - midnight(new Date(from))) / (24 * HOUR_MS));
  const clock = `${String(at.getHours()).padStart(2, "0")}:${String(at.getMinutes()).padStart(2, "0")}`;
  return days ? t("{clock} +{days} d", { clock, days }) : clock;
}

/** A moment of a plan as a text: of the day where it is known when the plan begins, since its begin otherwise. @param {number | null | undefined} time */
export function momentText(problem, time) {
  if (!Number.isFinite(time)) return "–";
  const from = begin(problem);
  return from === null ? since(problem, time) : ofTheDay(from, time);
}

/** The same as an element, with the exact number in it. */
export function moment(problem, time) {
  if (!Number.isFinite(time)) return h("data", {}, "–");
  const says = onGlobe(problem) ? t("{since} h after the begin", { since: since(problem, time).replace("+", "") }) : String(time);
  return h("data", { value: String(time), title: says }, momentText(problem, time));
}

/** How long something takes. */
export function durationText(problem, time) {
  return onGlobe(problem) ? t("{time} h", { time: hoursAndMinutes(time) }) : shown(time);
}

/** A length as a text. */
export function lengthText(problem, length, digits = 4) {
  return onGlobe(problem) ? t("{length} km", { length: shown(length, digits) }) : shown(length, digits);
}

/** The same as an element, with the exact number in it. */
export function length(problem, value, digits = 4) {
  return h("data", { value: String(value), title: String(value) }, lengthText(problem, value, digits));
}

/** A speed as a text. */
export function speedText(problem, speed) {
  return onGlobe(problem) ? t("{speed} km/h", { speed: shown(speed) }) : shown(speed);
}

/** Round moments from 0 to an end, at most nine of them: of the day where it is known when the plan begins. @returns {number[]} */
export function roundMoments(problem, end) {
  if (!onGlobe(problem)) return multiples(roundStep(end / MOST_TICKS), 0, end);
  const step = (MINUTES.find((minutes) => end * 60 <= MOST_TICKS * minutes) ?? MINUTES.at(-1) * Math.ceil((end * 60) / (MOST_TICKS * MINUTES.at(-1)))) / 60;
  const from = begin(problem);
  if (from === null) return multiples(step, 0, end);
  const start = new Date(from);
  const midnight = new Date(start.getFullYear(), start.getMonth(), start.getDate()).getTime();
  const first = (from - midnight) / HOUR_MS;
  return multiples(step, first, first + end).map((at) => Math.max(0, at - first));
}

function roundStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough || 1));
  return power * [1, 2, 5, 10].find((digit) => digit * power >= rough * 0.999);
}

function multiples(step, from, to) {
  const first = Math.ceil(from / step - 1e-9);
  return Array.from({ length: Math.max(0, Math.floor(to / step + 1e-9) - first + 1) }, (_, n) => Number(((first + n) * step).toPrecision(12)));
}
