/** Algorithms on the same problem, side by side: reward against time, numbers, plans next to each other. */

import { drawCurves } from "../curve.js";
import { h, notify, number } from "../dom.js";
import { showPlan } from "../history.js";
import { answeredBy } from "../plan_notes.js";
import { registerView } from "../registry.js";
import { allocate } from "../running.js";
import { uavCount } from "../sizes.js";
import { get, subscribe } from "../state.js";
import { taskPicture } from "../task_picture.js";
import { fixed, ofService, t, tn, tNodes } from "../texts.js";

const PREFERRED = ["auto", "transfer_qmix", "local_search", "ga", "greedy"];

let parts = null;
let stopping = null;
let compared = null; // {problem, runs: [{algorithm, trace, answer, error}]}

registerView({ id: "compare", title: t("Compare"), order: 40, layout: "page", mount, show: draw });

function mount(root) {
  parts = {
    choices: h("div", { class: "choices", role: "group", "aria-label": t("Algorithms") }),
    limit: h("input", { type: "number", min: "0.05", step: "any", value: "2", id: "compare-limit" }),
    seed: h("input", { type: "number", min: "0", step: "1", value: "123", id: "compare-seed" }),
    start: h("button", { type: "submit", class: "primary" }, t("Compare")),
    stop: h("button", { type: "button", class: "quiet", disabled: true, onclick: () => stopping?.abort() }, t("Stop")),
    status: h("p", { class: "muted", role: "status", "data-testid": "compare-status" }),
    time: h("div", { class: "curve", "data-testid": "compare-time" }),
    epochs: h("div", { class: "curve" }),
    numbers: h("div", { class: "scroll" }),
    trace: h("details", { hidden: true }),
    plans: h("div", { class: "plans" }),
  };
  root.append(
    h("h2", {}, t("Compare algorithms")),
    h("p", { class: "muted lead" },
      t("Each gets the problem on screen, the same seed and the same time, one after the other, so that none takes the machine from another.")),
    h("form", { class: "card compare-form", onsubmit: (event) => { event.preventDefault(); void run(); } },
      parts.choices,
      h("label", {}, t("Time limit, s"), " ", parts.limit),
      h("label", {}, t("Seed"), " ", parts.seed),
      h("p", { class: "actions" }, parts.start, " ", parts.stop)),
    parts.status,
    h("div", { class: "two" },
      h("section", { class: "card" }, h("h3", {}, t("Reward against time")), parts.time),
      h("section", { class: "card" }, h("h3", {}, t("Reward against epochs or generations")), parts.epochs)),
    h("section", { class: "card" }, h("h3", {}, t("Numbers")), parts.numbers, parts.trace),
    h("section", {}, h("h3", {}, t("Plans")), parts.plans));
  subscribe(["algorithms"], choices);
  choices();
  draw();
}

function choices() {
  const { algorithms } = get();
  const before = new Set([...parts.choices.querySelectorAll("input:checked")].map((box) => box.value));
  const wanted = before.size ? before : new Set(PREFERRED.filter((name) => algorithms.some((a) => a.name === name)));
  parts.choices.replaceChildren(
    ...algorithms.map(({ name, summary: english, comparison }) => {
      const summary = ofService("algorithms", english) ?? english;
      return h("label", { class: "chip", title: comparison ? t("For comparison: {summary}", { summary }) : summary },
        h("input", { type: "checkbox", name: "algorithm", value: name, checked: wanted.has(name) }), " ", name);
    }));
}

async function run() {
  const { problem } = get();
  const chosen = [...parts.choices.querySelectorAll("input:checked")].map((box) => box.value);
  if (!problem || !chosen.length) {
    notify(t("Choose at least one algorithm, and a problem."), "error");
    return;
  }
  stopping = new AbortController();
  parts.start.disabled = true;
  parts.stop.disabled = false;
  compared = { problem, runs: chosen.map((algorithm) => ({ algorithm, trace: [], answer: null, error: null })) };
  for (const each of compared.runs) {
    if (stopping.signal.aborted) break;
    parts.status.textContent = t("{algorithm} is running …", { algorithm: each.algorithm });
    try {
      each.answer = await allocate(
        { ...problem, algorithm: each.algorithm, seed: Number(parts.seed.value), time_limit_s: Number(parts.limit.value) },
        {
          signal: stopping.signal,
          onProgress: ({ best_reward: reward }, seconds) => {
            if (reward !== null && reward !== undefined) each.trace.push([seconds, reward]);
            drawTime();
          },
        });
      if (each.answer) each.trace = rising([...each.trace, [each.answer.elapsed_s, each.answer.reward]]);
    } catch (error) {
      each.error = error.message;
    }
    draw();
  }
  const done = compared.runs.filter((each) => each.answer).length;
  parts.status.textContent = t("{count} of {all} algorithms have a plan.", { count: done, all: compared.runs.length });
  parts.start.disabled = false;
  parts.stop.disabled = true;
}

/** The best so far at every moment; the last event may come before or after the end that the service measured. */
function rising(trace) {
  let best = -Infinity;
  return [...trace].sort((a, b) => a[0] - b[0]).map(([t, reward]) => [t, (best = Math.max(best, reward))]);
}

function drawTime() {
  const series = (compared?.runs ?? []).map((each) => ({ name: each.algorithm, points: rising(each.trace) }));
  drawCurves(parts.time, series, { x: t("seconds"), label: t("Reward of the best plan against time, a line an algorithm") });
}

function draw() {
  if (!parts) return;
  drawTime();
  const runs = compared?.runs ?? [];
  drawCurves(parts.epochs,
    runs.filter((each) => each.answer).map((each) => ({
      name: each.algorithm,
      points: each.answer.history.epoch.map((epoch, i) => [epoch, each.answer.history.reward[i]]),
    })),
    { x: t("epoch or generation"), label: t("Reward against epochs, a line an algorithm") });
  const best = Math.max(...runs.filter((each) => each.answer).map((each) => each.answer.reward));
  const bounded = runs.some((each) => each.answer?.bound != null);
  parts.numbers.replaceChildren(
    h("table", { "data-testid": "compare-numbers" },
      h("thead", {}, h("tr", {},
        [t("Algorithm"), t("Reward"), t("Of the best"), t("Satisfaction"), t("Distance"), t("Areas unmet"), t("Seconds"), ...(bounded ? [t("Bound")] : [])]
          .map((title, i) => h("th", { scope: "col", class: i ? "n" : null }, title)))),
      h("tbody", {}, runs.map((each) => row(each, best, bounded)))));
  parts.trace.hidden = !runs.length;
  parts.trace.replaceChildren(
    h("summary", {}, t("The curves in numbers")),
    h("table", {},
      h("thead", {}, h("tr", {}, [t("Algorithm"), t("Seconds"), t("Reward")].map((title) => h("th", { scope: "col" }, title)))),
      h("tbody", {}, runs.flatMap((each) => each.trace.map(([t, reward]) =>
        h("tr", {}, h("td", {}, each.algorithm), h("td", {}, number(t)), h("td", {}, number(reward))))))));
  parts.plans.replaceChildren(...runs.filter((each) => each.answer).map(card));
  if (!runs.length) parts.plans.append(h("p", { class: "muted" }, t("The plans come here.")));
}

function row({ algorithm, answer, error }, best, bounded) {
  if (!answer) {
    const why = error ?? t("no plan yet");
    return h("tr", {}, h("th", { scope: "row" }, algorithm), h("td", { colspan: "7", class: error ? "error" : "muted" }, why));
  }
  return h("tr", { class: answer.reward === best ? "best" : null, "data-algorithm": algorithm },
    h("th", { scope: "row" }, algorithm, " ", answeredBy(answer)),
    h("td", { class: "n" }, number(answer.reward, 5)),
    h("td", { class: "n" }, best > 0 ? `${fixed((100 * answer.reward) / best, 1)} %` : "–"),
    h("td", { class: "n" }, number(answer.satisfaction, 5)),
    h("td", { class: "n" }, number(answer.distance, 5)),
    h("td", { class: "n" }, number(answer.unmet.length)),
    h("td", { class: "n" }, number(answer.elapsed_s, 3)),
    bounded && h("td", { class: "n" }, answer.bound == null ? "–" : number(answer.bound.value ?? answer.bound, 5)));
}

function card({ algorithm, answer }) {
  const { problem } = compared;
  const flying = answer.routes.filter((route) => route.stops.length).length;
  const label = t("Plan of {algorithm}: reward {reward}", { algorithm, reward: answer.reward });
  return h("article", { class: "card plan" },
    h("h4", {}, algorithm),
    taskPicture(problem, { answer, label, width: 320, height: 220 }),
    h("p", {}, tNodes("Reward {reward}, {flying} of {uavs}, {unmet}", { reward: number(answer.reward), flying, uavs: uavCount(answer.routes.length), unmet: tn(answer.unmet.length, "{count} area unmet", "{count} areas unmet") })),
    h("button", { type: "button", class: "quiet", onclick: () => {
      showPlan(problem, answer, { problem });
      notify(t("The plan of {algorithm} is the one on the map now.", { algorithm }));
    } }, t("Take this plan")));
}
