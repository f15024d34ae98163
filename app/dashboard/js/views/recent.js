/** Recent plans: those of the service, and the problems that this browser has kept; each can be opened again. */

import { statusName } from "../allocation.js";
import { h, notify, number } from "../dom.js";
import { change, undo } from "../history.js";
import { forget, isOwn, keptProblem, keptProblems } from "../keep.js";
import { newOpening } from "../problem.js";
import { openPlan, recentPlans } from "../recent.js";
import { registerView } from "../registry.js";
import { sizeText } from "../sizes.js";
import { set } from "../state.js";
import { saidOfProblem } from "../said.js";
import { dateText, t } from "../texts.js";

let parts = null;

registerView({ id: "recent", title: t("Recent"), order: 80, layout: "page", mount, show: () => void load() });

function mount(root) {
  const head = (titles) => h("thead", {}, h("tr", {}, titles.map((title) => h("th", { scope: "col" }, title))));
  parts = {
    plans: h("tbody", {}),
    problems: h("tbody", {}),
    status: h("p", { class: "muted", role: "status", "data-testid": "recent-status" }),
    more: h("button", { type: "button", hidden: true, onclick: () => void said(next) }, t("Show more")),
    cursor: null,
  };
  root.append(
    h("h2", {}, t("Recent plans and problems")),
    h("p", { class: "muted lead" }, t("What is opened takes the place of what is on screen; Undo brings that back.")),
    h("section", { class: "card" }, h("h3", {}, t("Plans of the service")), parts.status,
      h("div", { class: "scroll" }, h("table", { "data-testid": "recent-plans" }, head([t("Open"), t("Asked for"), t("Job"), t("State"), t("Reward")]), parts.plans)),
      h("p", { class: "actions" }, parts.more)),
    h("section", { class: "card" }, h("h3", {}, t("Problems of this browser")),
      h("p", { class: "muted" }, t("Each tab keeps its own, with its plan and the steps to undo.")),
      h("div", { class: "scroll" }, h("table", { "data-testid": "kept-problems" }, head([t("Open"), t("Kept"), t("Problem"), t("Size"), t("Reward")]), parts.problems))));
}

async function load() {
  parts.plans.replaceChildren();
  parts.cursor = null;
  await said(next);
  await said(listProblems);
}

/** The next page of plans. */
async function next() {
  const { jobs, next: cursor } = await recentPlans(parts.cursor);
  parts.plans.append(...jobs.map(planRow));
  parts.cursor = cursor;
  parts.more.hidden = cursor === null;
  parts.status.textContent = parts.plans.childElementCount ? t("The newest first.") : t("The service has no plans yet.");
}

function planRow(job) {
  const failed = job.status === "failed";
  const open = () => said(async () => {
    await openPlan(job.id);
    set({ view: ["succeeded", "cancelled"].includes(job.status) ? "answer" : "allocate" });
    offerBack(t("Plan {plan} is open", { plan: job.id.slice(0, 8) }));
  });
  return h("tr", { dataset: { job: job.id } },
    h("td", {}, failed ? "–" : h("button", { type: "button", "aria-label": t("Open plan {plan}", { plan: job.id.slice(0, 8) }), onclick: open }, t("Open"))),
    h("td", {}, h("time", { datetime: job.created_at }, dateText(job.created_at))),
    h("td", { title: job.id }, job.id.slice(0, 8)),
    h("td", {}, h("span", { class: "chip", title: job.error && saidOfProblem(job.error) }, statusName(job.status))),
    h("td", {}, number(job.progress.best_reward)));
}

async function listProblems() {
  const all = await keptProblems();
  parts.problems.replaceChildren(...all.map(problemRow));
  if (!all.length) parts.problems.append(h("tr", {}, h("td", { colspan: "5" }, t("None yet."))));
}

function problemRow({ id, savedAt, name, uavs, areas, reward }) {
  const open = () => said(async () => {
    const { job: _j, past: _p, future: _f, ...step } = (await keptProblem(id)) ?? {};
    if (!step.problem) return listProblems();
    change({ ...step, opened: newOpening(), incumbent: null, selection: null });
    offerBack(t("{problem} is open, as a copy", { problem: name }));
    set({ view: step.answer ? "answer" : "problem" });
  });
  const drop = () => said(async () => {
    if (!confirm(t("Forget {problem}?", { problem: name }))) return;
    await forget(id);
    await listProblems();
  });
  return h("tr", { dataset: { kept: id } },
    h("td", {}, isOwn(id) ? h("span", { class: "chip" }, t("this tab"))
      : [h("button", { type: "button", "aria-label": t("Open {problem}", { problem: name }), onclick: open }, t("Open")), " ", h("button", { type: "button", class: "quiet", "aria-label": t("Forget {problem}", { problem: name }), onclick: drop }, t("Forget"))]),
    h("td", {}, dateText(savedAt)), h("td", {}, name), h("td", {}, sizeText(uavs, areas)), h("td", {}, number(reward)));
}

function offerBack(text) {
  notify(text, "info", { title: t("Undo"), act: undo });
}

/** Do something, and say what went wrong with it. */
async function said(act) {
  try {
    await act();
  } catch (error) {
    notify(error.message, "error");
  }
}
