/** Reward against something, a line an algorithm, as the paper's figures have it. */

import uPlot from "../vendor/uplot/uplot.js";
import { colourName, pattern } from "./colours.js";
import { h } from "./dom.js";
import { shown, t } from "./texts.js";

/** Lengths of strokes and gaps of the patterns of lines. */
const DASHES = [[], [9, 5], [2, 4], [9, 4, 2, 4]];

/**
 * Draw curves into an element, instead of what was there.
 * @param {HTMLElement} root
 * @param {{name: string, points: [number, number][]}[]} series points in order of their first number
 * @param {{x: string, height?: number, label: string}} options x: what the first numbers are
 */
export function drawCurves(root, series, { x, height = 260, label }) {
  root.curve?.destroy();
  root.curve = null;
  root.replaceChildren();
  root.setAttribute("role", "img");
  root.setAttribute("aria-label", label);
  const drawn = series.filter((each) => each.points.length);
  if (!drawn.length) {
    root.append(h("p", { class: "muted" }, t("Nothing to draw yet.")));
    return;
  }
  const xs = [...new Set(drawn.flatMap((each) => each.points.map(([at]) => at)))].sort((a, b) => a - b);
  const columns = drawn.map((each) => held(each.points, xs));
  const css = getComputedStyle(document.documentElement);
  const ink = css.getPropertyValue("--muted").trim() || "#555";
  const line = css.getPropertyValue("--line").trim() || "#ddd";
  const values = (_, marks) => marks.map((value) => shown(value, 6));
  const axis = { values, stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1 }, font: "12px system-ui" };
  root.curve = new uPlot(
    {
      width: Math.max(280, root.clientWidth),
      height,
      scales: { x: { time: false } },
      axes: [{ ...axis, label: x, labelFont: "12px system-ui", labelSize: 18 }, { ...axis, size: 56 }],
      legend: { live: false },
      cursor: { drag: { x: false, y: false } },
      series: [
        { label: x },
        ...drawn.map((each, i) => ({
          label: each.name,
          stroke: css.getPropertyValue(colourName(i)).trim(),
          dash: DASHES[pattern(i)],
          width: 2,
          paths: uPlot.paths.stepped({ align: 1 }),
          points: { show: each.points.length < 2 },
        })),
      ],
    },
    [xs, ...columns],
    root,
  );
}

/** Values of a curve at other places: the last one before, none outside of its own. */
function held(points, xs) {
  const end = points.at(-1)[0];
  let next = 0;
  let value = null;
  return xs.map((at) => {
    while (next < points.length && points[next][0] <= at) value = points[next++][1];
    return at <= end ? value : null;
  });
}
