/** Symbols on the map: an area with urgency and what is met, a UAV with its range left. */

import { paint } from "./colours.js";
import { h, svg } from "./dom.js";
import { rangeShare } from "./plan.js";

/**
 * Draw an area: a disc in the colour of its urgency, larger the more urgent it is, a ring that fills with what is met.
 * @param {{urgent: number, met: number, size: number}} facts urgency class 1 to 5, share met, size in pixels
 */
export function areaSymbol({ urgent, met, size }) {
  const r = size / 2 - 2;
  const around = 2 * Math.PI * r;
  const ring = svg("circle", {
    class: "met", cx: size / 2, cy: size / 2, r, transform: `rotate(-90 ${size / 2} ${size / 2})`,
    "stroke-dasharray": `${(met * around).toFixed(2)} ${around.toFixed(2)}`,
  });
  const drawn = svg("svg", { viewBox: `0 0 ${size} ${size}`, width: size, height: size, class: `area urgent-${urgent}` });
  drawn.append(svg("circle", { class: "need", cx: size / 2, cy: size / 2, r }), svg("circle", { class: "disc", cx: size / 2, cy: size / 2, r: r * (0.3 + 0.08 * urgent) }));
  if (met > 0) drawn.append(ring);
  return drawn;
}

/** Draw an area among very many: a dot in the colour of its urgency, with a rim where all is met. */
export function areaDot({ urgent, met }) {
  return h("i", { class: `dot urgent-${urgent}${met >= 1 ? " met" : ""}` });
}

/** How many UAVs wait at a place, in a corner of its symbol; nothing where none does. */
function badge(count) {
  return count ? h("span", { class: "count" }, String(count)) : null;
}

/** Draw a base: a house, with the number of UAVs that wait there. */
export function depotSymbol({ size, count }) {
  const drawn = svg("svg", { viewBox: "0 0 24 24", width: size, height: size, class: "depot" });
  drawn.append(svg("path", { d: "M2 11 12 3l10 8v11H2z" }), svg("path", { class: "door", d: "M8 22v-7h8v7z" }));
  return h("div", {}, drawn, badge(count));
}

/** Draw a place where UAVs wait: a rotor cross on a disc, with their number. */
export function startSymbol({ size, count }) {
  const drawn = svg("svg", { viewBox: "0 0 24 24", width: size, height: size, class: "start" });
  drawn.append(svg("circle", { cx: 12, cy: 12, r: 10.5 }), svg("path", { d: "M8 8 16 16M16 8 8 16" }), ...[[8, 8], [16, 8], [8, 16], [16, 16]].map(([cx, cy]) => svg("circle", { class: "rotor", cx, cy, r: 2.4 })));
  return h("div", {}, drawn, badge(count));
}

/** Draw a UAV among very many: a square in its colour, hollow where it is returning. */
export function uavDot(uav) {
  const drawn = h("i", { class: `dot uav${uav.ret ? " returning" : ""}` });
  return paint(drawn, uav.id);
}

/** Draw a UAV: a rotor cross in its colour, the range left as a bar below; hollow where it is returning. */
export function uavSymbol(uav, size) {
  const left = rangeShare(uav);
  const drawn = svg("svg", { viewBox: "0 0 24 28", width: size, height: (size * 28) / 24, class: `uav${uav.ret ? " returning" : ""}` });
  paint(drawn, uav.id);
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
