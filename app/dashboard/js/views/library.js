/** The library of source tasks: pictures, metrics, similarity to the problem on screen; registering, training. */

import { statusName } from "../allocation.js";
import { json, send } from "../api.js";
import { drawCurves } from "../curve.js";
import { h, notify, number } from "../dom.js";
import { registerView } from "../registry.js";
import { finished } from "../running.js";
import { areaCount, uavCount } from "../sizes.js";
import { get, subscribe } from "../state.js";
import { taskPicture } from "../task_picture.js";
import { listed, t, tn } from "../texts.js";

const PAGE = 24;

let parts = null;
let shownAt = 0;
const tasks = new Map(); // id → the policy with its task

registerView({ id: "library", title: t("Library"), order: 60, layout: "page", mount, show: () => void load() });

function mount(root) {
  parts = {
    status: h("p", { class: "muted", role: "status", "data-testid": "library-status" }),
    cards: h("div", { class: "policies", "data-testid": "policies" }),
    more: h("button", { type: "button", hidden: true, onclick: () => void load(shownAt + PAGE) }, t("Show more")),
    registerName: h("input", { name: "name", required: true, maxlength: "256" }),
    register: h("button", { type: "submit", class: "primary" }, t("Register")),
    registerHint: h("p", { class: "muted" }),
    trainName: h("input", { name: "name", required: true, maxlength: "256" }),
    mode: h("select", { name: "mode" },
      h("option", { value: "paper" }, t("paper: Algorithm 1")), h("option", { value: "service" }, t("service: any size"))),
    epochs: h("input", { name: "n_epochs", type: "number", min: "1", step: "1", value: "300", required: true }),
    seed: h("input", { name: "seed", type: "number", min: "0", step: "1", value: "123", required: true }),
    train: h("button", { type: "submit", class: "primary" }, t("Train")),
    cancel: h("button", { type: "button", class: "quiet", disabled: true }, t("Cancel")),
    progress: h("progress", { max: "1", value: "0", hidden: true, "aria-label": t("Training") }),
    watched: h("p", { role: "status", "data-testid": "training-status" }),
    curve: h("div", { class: "curve" }),
  };
  root.append(
    h("h2", {}, t("Library of source tasks")),
    h("div", { class: "two" },
      h("form", { class: "card", onsubmit: (event) => { event.preventDefault(); void register(); } },
        h("h3", {}, t("Register the policy of this allocation")),
        parts.registerHint,
        h("label", { class: "line" }, h("span", {}, t("Name")), parts.registerName),
        h("p", { class: "actions" }, parts.register)),
      h("form", { class: "card", onsubmit: (event) => { event.preventDefault(); void train(); } },
        h("h3", {}, t("Train on the problem on screen")),
        h("div", { class: "columns" },
          h("label", {}, t("Name"), parts.trainName),
          h("label", {}, t("Mode"), parts.mode),
          h("label", {}, t("Epochs"), parts.epochs),
          h("label", {}, t("Seed"), parts.seed)),
        h("p", { class: "actions" }, parts.train, " ", parts.cancel),
        parts.progress, parts.watched, parts.curve)),
    parts.status, parts.cards, h("p", { class: "actions" }, parts.more));
  subscribe(["answer", "problemName", "fields"], hint);
  subscribe(["problem"], () => { if (get().view === "library") void load(); });
  hint();
}

function hint() {
  const { answer, problemName, fields } = get();
  const learners = fields?.learners ?? [];
  const learned = answer && learners.includes(answer.algorithm);
  parts.register.disabled = !learned;
  parts.registerHint.textContent = !answer
    ? t("There is no allocation yet.")
    : learned
      ? t("{algorithm}, reward {reward}. It has a policy of its own where it was fine-tuned and allocated with “Keep what is learned”.", answer)
      : t("{algorithm} learns nothing; allocate with one that learns ({learners}), and with “Keep what is learned”.", { algorithm: answer.algorithm, learners: listed(learners) });
  if (!parts.trainName.value) parts.trainName.value = problemName || t("my task");
  if (!parts.registerName.value) parts.registerName.value = t("{task}, fine-tuned", { task: problemName || t("my task") });
}

async function load(count = Math.max(PAGE, shownAt)) {
  const { problem } = get();
  shownAt = count;
  try {
    const all = [];
    let cursor = null;
    do {
      const page = await json(`library?limit=100${cursor ? `&cursor=${cursor}` : ""}`);
      all.push(...page.policies);
      cursor = page.next_cursor;
    } while (cursor);
    const distances = new Map();
    if (problem?.uavs.length && problem.targets.length) {
      const near = await json("library/similar", { method: "POST", body: { task: problem, k: 100 } });
      for (const { policy, distance } of near.similar) distances.set(policy.id, distance);
    }
    const far = (policy) => distances.get(policy.id) ?? Infinity;
    all.sort((a, b) => far(a) - far(b) || a.name.localeCompare(b.name));
    const listed = all.slice(0, shownAt);
    await Promise.all(listed.filter(({ id }) => !tasks.has(id)).map(async ({ id }) =>
      tasks.set(id, await json(`library/${encodeURIComponent(id)}`))));
    parts.cards.replaceChildren(...listed.map((policy, i) => card(policy, distances.get(policy.id), i)));
    parts.more.hidden = all.length <= shownAt;
    parts.status.textContent = tn(all.length, "{count} source policy, the most similar to the problem on screen first.", "{count} source policies, the most similar to the problem on screen first.");
  } catch (error) {
    parts.status.textContent = error.message;
  }
}

function card(policy, distance, place) {
  const { task } = tasks.get(policy.id);
  const size = listed([uavCount(policy.n_uavs), areaCount(policy.n_targets), tn(policy.n_materials, "{count} material", "{count} materials")]);
  const metrics = Object.entries(policy.metrics).filter(([, value]) => typeof value === "number").slice(0, 6);
  return h("article", { class: "card policy", "data-policy": policy.id },
    h("h3", {}, policy.name),
    taskPicture(task, { label: t("Source task of {policy}: {size}", { policy: policy.name, size }) }),
    h("p", { class: "chips" },
      h("span", { class: "chip" }, policy.algorithm),
      h("span", { class: "chip" }, policy.architecture),
      place === 0 && distance !== undefined && h("span", { class: "chip good" }, t("most similar"))),
    h("dl", { class: "pairs" },
      h("dt", {}, t("UAVs × areas × materials")), h("dd", {}, `${policy.n_uavs} × ${policy.n_targets} × ${policy.n_materials}`),
      h("dt", {}, t("Distance to this problem")), h("dd", { class: "similarity" }, distance === undefined ? "–" : number(distance)),
      metrics.flatMap(([name, value]) => [h("dt", {}, name.replaceAll("_", " ")), h("dd", {}, number(value))])),
    h("button", { type: "button", class: "quiet", "aria-label": t("Delete {item}", { item: policy.name }), onclick: () => void drop(policy) }, t("Delete")));
}

async function drop(policy) {
  if (!confirm(t("Delete {policy} from the library?", { policy: policy.name }))) return;
  await said(async () => {
    await send(`library/${encodeURIComponent(policy.id)}`, { method: "DELETE" });
    tasks.delete(policy.id);
    notify(t("{policy} is deleted.", { policy: policy.name }));
    await load();
  });
}

async function register() {
  const { answer } = get();
  await said(async () => {
    const policy = await json("library", { method: "POST", body: { name: parts.registerName.value, job_id: answer.job_id } });
    notify(t("{policy} is in the library.", { policy: policy.name }));
    await load();
  });
}

async function train() {
  const parameters = { mode: parts.mode.value, n_epochs: Number(parts.epochs.value) };
  const body = { name: parts.trainName.value, task: get().problem, train: { algorithm: "qmix", parameters, seed: Number(parts.seed.value) } };
  parts.train.disabled = true;
  const points = [];
  await said(async () => {
    const job = await json("library", { method: "POST", body });
    parts.cancel.disabled = false;
    parts.cancel.onclick = () => void said(() => json(`jobs/${job.id}`, { method: "DELETE" }));
    parts.progress.hidden = false;
    parts.watched.textContent = t("The training waits for a worker.");
    const ended = await finished(job.id, ({ fraction, epoch, best_reward: reward }) => {
      parts.progress.value = fraction;
      if (reward === null || reward === undefined) return;
      points.push([epoch ?? points.length, reward]);
      parts.watched.textContent = t("Epoch {epoch}, best reward {reward}.", { epoch: epoch ?? "–", reward });
      drawCurves(parts.curve, [{ name: t("best reward"), points }], { x: t("epoch"), height: 180, label: t("Best reward against epochs") });
    });
    const id = ended.result?.policy_id;
    parts.watched.textContent = id ? t("Trained: {policy} is in the library as {id}.", { policy: body.name, id }) : t("The training has ended: {status}.", { status: statusName(ended.status) });
    const { history } = ended.result ?? {};
    if (history) {
      const line = { name: t("reward"), points: history.epoch.map((epoch, i) => [epoch, history.reward[i]]) };
      drawCurves(parts.curve, [line], { x: t("epoch"), height: 180, label: t("Reward against epochs") });
    }
    await load();
  });
  parts.train.disabled = false;
  parts.cancel.disabled = true;
}

/** Do something, and say what went wrong with it. */
async function said(act) {
  try {
    await act();
  } catch (error) {
    notify(error.message, "error");
  }
}
