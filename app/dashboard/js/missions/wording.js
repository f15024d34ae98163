/** Events of a mission and what they did, in words. */

import { shortAmounts } from "../dom.js";
import { baseName } from "../plan.js";
import { ruleText } from "../reasons.js";
import { listed, t, tn } from "../texts.js";

const stopOf = (each) => each.target_id ?? baseName(each.base_id);
const idsOf = (items) => listed(items.map(({ id }) => id));

const SAYS = {
  begun: () => t("The mission began"),
  telemetry: ({ positions }) => tn(positions.length, "{count} position", "{count} positions"),
  clock: () => t("Time has passed"),
  visit_done: (event) => t("{uav} visited {area}, unloaded {amounts}", { uav: event.uav_id, area: event.target_id, amounts: shortAmounts(event.delivered) }),
  reload_done: (event) => t("{uav} reloaded at {base}", { uav: event.uav_id, base: event.base_id }),
  uav_lost: (event) => t("{uav} is lost", { uav: event.uav_id }),
  uavs_added: ({ uavs }) => t("New: {items}", { items: idsOf(uavs) }),
  uav_delayed: (event) => t("{uav} is delayed until {until}", { uav: event.uav_id, until: event.until }),
  areas_added: ({ targets }) => t("New: {items}", { items: idsOf(targets) }),
  areas_changed: ({ targets }) => t("Need or place changed: {items}", { items: idsOf(targets) }),
  area_cancelled: (event) => t("{area} is cancelled", { area: event.target_id }),
  level_changed: (event) => t("Urgency of {area} is {level}", { area: event.target_id, level: event.level }),
  stock_changed: (event) => t("Stock of {base}: {amounts}", { base: event.base_id, amounts: event.stock ? shortAmounts(event.stock) : t("as much as is asked for") }),
  zones_changed: ({ no_fly_zones: zones }) => (zones.length ? t("No-fly zones: {count}", { count: zones.length }) : t("No-fly zones: none")),
  wind_changed: ({ wind }) => (wind ? t("Wind {speed} towards {direction}°", { speed: wind.speed, direction: wind.towards }) : t("Still air")),
  plan_proposed: (_, number) => t("Plan {plan} is proposed", { plan: number }),
  proposal_accepted: (event) => t("Plan {plan} is accepted", { plan: event.proposal }),
  proposal_refused: (event) => t("Plan {plan} is refused", { plan: event.proposal }),
};

/** What has happened. @param {{type: string, event: object, number: number}} entry of the history, or an event that was not sent */
export function happened({ type, event, number }) {
  return SAYS[type]?.(event, number) ?? type.replaceAll("_", " ");
}

/** What it did to the plan in force; empty where it did nothing. */
export function effectOf({ effect, passed_over: passed }) {
  if (passed) return tn(passed, "{count} was older than what is known", "{count} were older than what is known");
  if (!effect) return "";
  const broken = effect.broken.map((each) => t("{uav} does not stop at {place}: {why}", { uav: each.uav_id, place: stopOf(each), why: ruleText(each) }));
  const late = effect.late.map((each) => t("{uav} is at {place} at {time}, not {planned}", { uav: each.uav_id, place: stopOf(each), time: each.arrival_time, planned: each.planned }));
  return [...broken, ...late].join("; ");
}

/** What is said of an event that was just told. */
export function told(entry) {
  const { effect } = entry;
  const plan = effect?.flyable === false ? tn(effect.broken.length, "{count} stop was dropped from the plan", "{count} stops were dropped from the plan") : t("the plan can be flown as it is");
  return `${happened(entry)}: ${plan}`;
}
