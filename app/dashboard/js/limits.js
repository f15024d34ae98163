/** Limits of numbers, as the service's description has them, and those of the globe. */

import { t } from "./texts.js";

const PLACES = ["x", "y", "x_s", "y_s", "x_c", "y_c"];
/** Degrees from the middle, by the letter that names of fields begin with. */
export const DEGREES = { x: 180, y: 90 };

/** The schema of a field, with the ends of the globe where it is a position there. */
export function onEarth(name, schema, globe) {
  const most = globe && PLACES.includes(name) && DEGREES[name[0]];
  return most ? { ...schema, minimum: -most, maximum: most } : schema;
}

/** A minimum as small as this only keeps numbers from being 0. */
export const TINY = 1e-9;
/** A limit beyond this, or beyond its negative, says nothing to anybody. */
export const NO_LIMIT = 1e9;

/** What a number has to be, where it is beyond its limits; null where it is not. @returns {string | null} */
export function beyond(value, { minimum = -Infinity, maximum = Infinity, exclusiveMinimum = -Infinity }) {
  if (value >= minimum && value <= maximum && value > exclusiveMinimum) return null;
  const positive = minimum > 0 && minimum <= TINY;
  if (positive || exclusiveMinimum > -Infinity) return t("it has to be more than {limit}", { limit: positive ? 0 : exclusiveMinimum });
  if (minimum > -NO_LIMIT && maximum < NO_LIMIT) return t("it has to be from {low} to {high}", { low: minimum, high: maximum });
  return value < minimum ? t("it has to be at least {limit}", { limit: minimum }) : t("it has to be at most {limit}", { limit: maximum });
}
