/** Events of a mission and what they did, in words. */

import { shown, shortAmounts } from "../dom.js";

const stopOf = (each) => each.target_id ?? `base ${each.base_id}`;

const SAYS = {
  begun: () => "The mission began",
  telemetry: ({ positions }) => `${positions.length} ${positions.length === 1 ? "position" : "positions"}`,
  clock: () => "Time has passed",
  visit_done: (event) => `${event.uav_id} visited ${event.target_id}, unloaded ${shortAmounts(event.delivered)}`,
  reload_done: (event) => `${event.uav_id} reloaded at ${event.base_id}`,
  uav_lost: (event) => `${event.uav_id} is lost`,
  uavs_added: ({ uavs }) => `New: ${uavs.map(({ id }) => id).join(", ")}`,
  uav_delayed: (event) => `${event.uav_id} is delayed until ${shown(event.until)}`,
  areas_added: ({ targets }) => `New: ${targets.map(({ id }) => id).join(", ")}`,
  areas_changed: ({ targets }) => `Found otherwise: ${targets.map(({ id }) => id).join(", ")}`,
  area_cancelled: (event) => `${event.target_id} is cancelled`,
  level_changed: (event) => `Urgency of ${event.target_id} is ${shown(event.level)}`,
  stock_changed: (event) => `Stock of ${event.base_id}: ${event.stock ? shortAmounts(event.stock) : "as much as is asked for"}`,
  zones_changed: ({ no_fly_zones: zones }) => `No-fly zones: ${zones.length || "none"}`,
  wind_changed: ({ wind }) => (wind ? `Wind ${shown(wind.speed)} towards ${shown(wind.towards)}°` : "Still air"),
  plan_proposed: (_, number) => `Plan ${number} is proposed`,
  proposal_accepted: (event) => `Plan ${event.proposal} is accepted`,
  proposal_refused: (event) => `Plan ${event.proposal} is refused`,
};

/** What has happened. @param {{type: string, event: object, number: number}} entry of the history, or an event that was not sent */
export function happened({ type, event, number }) {
  return SAYS[type]?.(event, number) ?? type.replaceAll("_", " ");
}

/** What it did to the plan in force; empty where it did nothing. */
export function effectOf({ effect, passed_over: passed }) {
  if (passed) return `${passed} ${passed === 1 ? "was" : "were"} older than what is known`;
  if (!effect) return "";
  const broken = effect.broken.map((each) => `${each.uav_id} does not stop at ${stopOf(each)}: ${each.says}`);
  const late = effect.late.map((each) => `${each.uav_id} is at ${stopOf(each)} at ${shown(each.arrival_time)}, not ${shown(each.planned)}`);
  return [...broken, ...late].join("; ");
}

/** What is said of an event that was just told. */
export function told(entry) {
  const { effect } = entry;
  const plan = effect?.flyable === false ? `${effect.broken.length} ${effect.broken.length === 1 ? "stop was" : "stops were"} dropped from the plan` : "the plan can be flown as it is";
  return `${happened(entry)}: ${plan}`;
}
