/** What the service warns of, in the language of the page: by the code, with the figures of the problem at its pointer. */

import { materialName } from "./materials.js";
import { called } from "./plan.js";
import { get } from "./state.js";
import { t, tn } from "./texts.js";
import { lengthText, speedText } from "./units.js";

/** Warnings of one code that the service lists at most. */
export const MOST_OF_A_CODE = 10;

const TEXTS = {
  all_returning: () => t("Every UAV is returning, so none can be sent."),
  committed_beyond_steps({ item, problem }) {
    const steps = problem.max_steps ?? get().fields.settings.max_steps.default;
    return tn(item.committed.length, "{count} visit is promised of {uav}, in {steps} decision steps.", "{count} visits are promised of {uav}, in {steps} decision steps.", { uav: called(item), steps });
  },
  committed_in_vain: ({ item }) => t("A visit that is promised of {uav} cannot be made, and it makes no other one before it.", { uav: called(item) }),
  coordinates_swapped: ({ place }) => t("Far off, and near with latitude and longitude exchanged: {place}.", { place }),
  deadline_passed: ({ item }) => t("The deadline of {area} has passed.", { area: called(item) }),
  degrees_on_plane: () => t("Positions look like degrees, but the map is a plane."),
  earliest_after_deadline: ({ item }) => t("{area} takes no visit before its deadline: who arrives in time waits.", { area: called(item) }),
  far_point: ({ place }) => t("Out of range, and far from all else: {place}.", { place }),
  inside_zone: ({ place }) => t("In a no-fly zone, so that no way leads there or away: {place}.", { place }),
  never_available: ({ item }) => t("{uav} has to have landed before it may take off.", { uav: called(item) }),
  no_capacity: ({ item }) => t("Loads are planned, and {uav} has no capacity: it can take aboard whatever is in stock.", { uav: called(item) }),
  no_level: () => t("The urgency of every area that needs anything is 0, so nothing is worth a flight."),
  none_in_range: ({ problem }) => (problem.objective?.return_to_base === false ? t("No UAV that can be sent has the range for any area that needs anything.") : t("No UAV that can be sent has the range for any area that needs anything, and for the way home.")),
  not_carried: ({ problem, k }) => t("Areas need {material}, and no UAV that can be sent carries any, or can load any.", { material: materialName(problem, k) }),
  not_needed: ({ problem, k }) => t("UAVs carry {material}, and no area needs any.", { material: materialName(problem, k) }),
  nothing_needed: () => t("No area needs anything."),
  one_place: () => t("All positions are one and the same."),
  range_implausible: ({ item, problem }) => t("The range of {uav}, {length}, is more than once round the Earth.", { uav: called(item), length: lengthText(problem, item.voyage) }),
  range_spent: ({ item, problem }) => t("{uav} has flown {flown}, more than its range of {range}.", { uav: called(item), flown: lengthText(problem, item.dis), range: lengthText(problem, item.voyage) }),
  speed_implausible: ({ item, problem }) => t("{uav} flies at {speed}: that is unusually slow or fast.", { uav: called(item), speed: speedText(problem, item.speed) }),
  wind_too_strong: ({ item, problem }) => t("{uav} flies at {speed}, no faster than the wind: it cannot fly against it.", { uav: called(item), speed: speedText(problem, item.speed) }),
};

/**
 * One warning.
 * @param {object} problem the one that was asked about @param {{pointer: string, code: string, detail: string}} warning
 * @returns {string} the service's own sentence, in English, where its code is not known here
 */
export function warningText(problem, { pointer, code, detail }) {
  const [, kind, at, field, k] = pointer.split("/");
  const item = problem[kind]?.[Number(at)];
  const place = item && (field === "x_s" ? t("starting point of {uav}", { uav: called(item) }) : called(item));
  return TEXTS[code]?.({ problem, item, place, k: Number(k) }) ?? detail;
}
