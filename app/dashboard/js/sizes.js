/** Sizes of problems in words. */

import { listed, tn } from "./texts.js";

export function uavCount(count) {
  return tn(count, "{count} UAV", "{count} UAVs");
}

export function areaCount(count) {
  return tn(count, "{count} area", "{count} areas");
}

/** How many UAVs and areas a problem has. */
export function sizeText(uavs, areas) {
  return listed([uavCount(uavs), areaCount(areas)]);
}
