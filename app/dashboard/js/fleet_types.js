/** Types of UAVs to begin with. */

import { t } from "./texts.js";

/**
 * Figures that are usual for each class, rounded, at the load that is named; a UAV of a type is called after it.
 * `speed` in km/h, `voyage` in km of one flight out and back, `load` in kg.
 */
export const TYPES = [
  { id: "multirotor", name: t("Multirotor"), speed: 45, voyage: 15, load: 2.5 },
  { id: "heavy-multirotor", name: t("Heavy multirotor"), speed: 50, voyage: 16, load: 30 },
  { id: "vtol", name: t("VTOL"), speed: 100, voyage: 75, load: 4.5 },
  { id: "fixed-wing", name: t("Fixed wing"), speed: 100, voyage: 150, load: 1.7 },
  { id: "heavy-fixed-wing", name: t("Heavy fixed wing"), speed: 130, voyage: 800, load: 100 },
];
