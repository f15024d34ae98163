/** A task, and if there is one its plan, as a small picture. */

import { paint } from "./colours.js";
import { svg } from "./dom.js";
import { idOf } from "./kinds.js";
import { atBase, placeOf, placesOf } from "./stops.js";

/**
 * Draw a task.
 * @param {object} task the problem
 * @param {object} options answer: a plan to draw; label: for those who do not see it; width, height: of the box
 * @returns {SVGElement}
 */
export function taskPicture(task, { answer = null, label = "", width = 240, height = 160 } = {}) {
  const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label, class: "task-picture" });
  const spots = [
    ...task.uavs.flatMap((uav) => [[uav.x_s, uav.y_s], [uav.x_c ?? uav.x_s, uav.y_c ?? uav.y_s]]),
    ...[...task.targets, ...(task.bases ?? [])].map(({ x, y }) => [x, y]),
    ...(task.no_fly_zones ?? []).flatMap(({ polygon }) => polygon),
  ];
  const xs = spots.map(([x]) => x);
  const ys = spots.map(([, y]) => y);
  const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const margin = 10;
  const scale = Math.min((width - 2 * margin) / (right - left || 1), (height - 2 * margin) / (high - low || 1));
  const dx = (width - scale * (right - left)) / 2;
  const dy = (height - scale * (high - low)) / 2;
  const at = ([x, y]) => [dx + (x - left) * scale, height - dy - (y - low) * scale];
  const line = (points) => points.map((place) => at(place).map((value) => value.toFixed(1)).join(",")).join(" ");
  for (const { polygon } of task.no_fly_zones ?? []) picture.append(svg("polygon", { points: line(polygon), class: "no-fly-zone" }));
  const named = (list) => (task[list] ?? []).map((item, at) => ({ ...item, id: idOf(list, item, at) }));
  const places = placesOf({ targets: named("targets"), bases: named("bases") });
  answer?.routes.forEach((route, i) => {
    if (!route.stops.length) return;
    const uav = task.uavs[i];
    const way = (place, path) => path?.slice(1) ?? [[places.get(place).x, places.get(place).y]];
    const home = route.landing?.base_id ? way(atBase(route.landing.base_id), route.landing.path) : (route.landing?.path?.slice(1) ?? [[uav.x_s, uav.y_s]]);
    const points = [[uav.x_c ?? uav.x_s, uav.y_c ?? uav.y_s], ...route.stops.flatMap((stop) => way(placeOf(stop), stop.path)), ...home];
    picture.append(paint(svg("polyline", { points: line(points), class: "route", "data-uav": route.uav_id }), route.uav_id, i));
  });
  const most = Math.max(1e-12, ...task.targets.map((target) => target.level));
  const unmet = new Set(answer?.unmet.map((each) => each.target_id));
  task.targets.forEach((target, j) => {
    const [cx, cy] = at([target.x, target.y]);
    const urgency = target.level / most;
    const met = answer && !unmet.has(idOf("targets", target, j));
    picture.append(
      svg("circle", {
        cx: cx.toFixed(1), cy: cy.toFixed(1), r: (2.5 + 2.5 * urgency).toFixed(1), class: met ? "area met" : "area",
        "fill-opacity": met ? 1 : (0.35 + 0.65 * urgency).toFixed(2),
      }),
    );
  });
  for (const base of task.bases ?? []) {
    const [x, y] = at([base.x, base.y]);
    picture.append(svg("rect", { x: (x - 4).toFixed(1), y: (y - 4).toFixed(1), width: 8, height: 8, class: "depot" }));
  }
  for (const uav of task.uavs) {
    const [x, y] = at([uav.x_c ?? uav.x_s, uav.y_c ?? uav.y_s]);
    picture.append(svg("path", { d: `M${x.toFixed(1)} ${(y - 4).toFixed(1)}l3.5 6.5h-7z`, class: "uav" }));
  }
  return picture;
}
