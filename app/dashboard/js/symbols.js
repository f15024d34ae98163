/** Symbols on the map: an area with urgency and what is met, a UAV with its range left. */

import { svg } from "./dom.js";
import { hue, rangeLeft, urgency } from "./plan.js";

/**
 * Draw an area: a disc in the colour of its urgency, a ring that fills with what is met.
 * @param {object} target
 * @param {{highest: number, met: number, size: number}} facts size in pixels
 */
export function areaSymbol(target, { highest, met, size }) {
  const r = size / 2 - 2;
  const around = 2 * Math.PI * r;
  const ring = svg("circle", {
    class: "met", cx: size / 2, cy: size / 2, r, transform: `rotate(-90 ${size / 2} ${size / 2})`,
    "stroke-dasharray": `${(met * around).toFixed(2)} ${around.toFixed(2)}`,
  });
  const drawn = svg("svg", { viewBox: `0 0 ${size} ${size}`, width: size, height: size, class: `area urgent-${urgency(target.level, highest)}` });
  drawn.append(svg("circle", { class: "need", cx: size / 2, cy: size / 2, r }), svg("circle", { class: "disc", cx: size / 2, cy: size / 2, r: r * 0.55 }));
  if (met > 0) drawn.append(ring);
  return drawn;
}

/** Draw a UAV: a rotor cross in its colour, the range left as a bar below; hollow where it is returning. */
export function uavSymbol(uav, index, size) {
  const left = uav.voyage > 0 ? Math.max(0, Math.min(1, rangeLeft(uav) / uav.voyage)) : 0;
  const drawn = svg("svg", { viewBox: "0 0 24 28", width: size, height: (size * 28) / 24, class: `uav${uav.ret ? " returning" : ""}` });
  drawn.style.setProperty("--hue", hue(index));
  drawn.append(
    svg("path", { class: "arms", d: "M6 6 18 18M18 6 6 18" }),
    ...[[5, 5], [19, 5], [5, 19], [19, 19]].map(([cx, cy]) => svg("circle", { class: "rotor", cx, cy, r: 4 })),
    svg("rect", { class: "range", x: 1, y: 25, width: 22, height: 3, rx: 1.5 }),
    svg("rect", { class: "left", x: 1, y: 25, width: (22 * left).toFixed(2), height: 3, rx: 1.5 }),
  );
  return drawn;
}

/** Pixels by which the n-th of several UAVs at one place is drawn aside, in a sunflower's order. */
export function aside(n, size) {
  if (n === 0) return [0, 0];
  const angle = (n * 137.508 * Math.PI) / 180;
  const far = size * 0.78 * Math.sqrt(n + 0.6);
  return [far * Math.cos(angle), far * Math.sin(angle)];
}
