/** What the symbols on the map say when the pointer is on them: a fact a line. */

import { stockText } from "./bases.js";
import { amountsText } from "./materials.js";
import { called, rangeLeft, stateText } from "./plan.js";
import { requestedBy } from "./problem.js";
import { shown, t, tn } from "./texts.js";
import { durationText, lengthText, momentText } from "./units.js";

const MOST_NAMED = 8;

/** @param {object} problem @param {object} area @param {number | null} share met by a plan, 0 to 1; null: there is none */
export function areaTip(problem, area, share) {
  const needs = { amounts: amountsText(problem, area.loadlist), asked: amountsText(problem, requestedBy(area)) };
  return [
    t("{area} · urgency {level}", { area: called(area), level: shown(area.level) }),
    area.requested ? t("needs {amounts} of {asked}", needs) : t("needs {amounts}", needs),
    share !== null && share !== undefined && t("{percent} % met", { percent: shown(100 * share, 3) }),
    area.earliest && t("from {time}", { time: momentText(problem, area.earliest) }),
    area.deadline !== undefined && t("by {time}", { time: momentText(problem, area.deadline) }),
  ].filter(Boolean).join("\n");
}

/** @param {Map<string, number[] | null>} left stocks after the plan, by base */
export function baseTip(problem, base, uavs, left) {
  return [
    t("{base} · base", { base: called(base) }),
    t("stock {stock}", { stock: stockText(problem, base.stock) }),
    left.has(base.id) && t("after the plan {stock}", { stock: stockText(problem, left.get(base.id)) }),
    base.turnaround && t("turnaround {time}", { time: durationText(problem, base.turnaround) }),
    uavs.length > 0 && startTip(uavs),
  ].filter(Boolean).join("\n");
}

export function startTip(uavs) {
  const some = uavs.slice(0, MOST_NAMED).map(called).join(", ");
  return tn(uavs.length, "{count} UAV waits here: {uavs}", "{count} UAVs wait here: {uavs}", { uavs: uavs.length > MOST_NAMED ? `${some}, …` : some });
}

export function uavTip(problem, uav) {
  return [
    t("{uav} · {state}", { uav: called(uav), state: stateText(uav) }),
    t("range left {left} of {range}", { left: lengthText(problem, rangeLeft(uav)), range: lengthText(problem, uav.voyage) }),
    t("carries {amounts}", { amounts: amountsText(problem, uav.loadlist) }),
  ].join("\n");
}
