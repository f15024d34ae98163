/** What the symbols on the map say when the pointer is on them: a fact a line. */

import { shown } from "./dom.js";
import { stockText } from "./bases.js";
import { amountsText } from "./materials.js";
import { called, rangeLeft, stateOf } from "./plan.js";
import { requestedBy } from "./problem.js";
import { counted, filledText } from "./sentences.js";
import { durationText, lengthText, momentText } from "./units.js";

const MOST_NAMED = 8;
const WAIT = { one: "1 UAV waits here: {uavs}", other: "{count} UAVs wait here: {uavs}" };

/** @param {object} problem @param {object} area @param {number | null} share met by a plan, 0 to 1; null: there is none */
export function areaTip(problem, area, share) {
  const needs = { amounts: amountsText(problem, area.loadlist), asked: amountsText(problem, requestedBy(area)) };
  return [
    filledText("{area} · urgency {level}", { area: called(area), level: shown(area.level) }),
    filledText(area.requested ? "needs {amounts} of {asked}" : "needs {amounts}", needs),
    share !== null && share !== undefined && filledText("{percent} % met", { percent: shown(100 * share, 3) }),
    area.earliest && filledText("from {time}", { time: momentText(problem, area.earliest) }),
    area.deadline !== undefined && filledText("by {time}", { time: momentText(problem, area.deadline) }),
  ].filter(Boolean).join("\n");
}

/** @param {Map<string, number[] | null>} left stocks after the plan, by base */
export function baseTip(problem, base, uavs, left) {
  return [
    filledText("{base} · base", { base: called(base) }),
    filledText("stock {stock}", { stock: stockText(problem, base.stock) }),
    left.has(base.id) && filledText("after the plan {stock}", { stock: stockText(problem, left.get(base.id)) }),
    base.turnaround && filledText("turnaround {time}", { time: durationText(problem, base.turnaround) }),
    uavs.length > 0 && startTip(uavs),
  ].filter(Boolean).join("\n");
}

export function startTip(uavs) {
  const some = uavs.slice(0, MOST_NAMED).map(called).join(", ");
  return filledText(counted(uavs.length, WAIT), { count: uavs.length, uavs: uavs.length > MOST_NAMED ? `${some}, …` : some });
}

export function uavTip(problem, uav) {
  return [
    filledText("{uav} · {state}", { uav: called(uav), state: stateOf(uav) }),
    filledText("range left {left} of {range}", { left: lengthText(problem, rangeLeft(uav)), range: lengthText(problem, uav.voyage) }),
    filledText("carries {amounts}", { amounts: amountsText(problem, uav.loadlist) }),
  ].join("\n");
}
