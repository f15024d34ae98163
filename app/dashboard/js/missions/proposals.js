/** Plans that were proposed for a mission: what each changes and gains, to accept or to refuse. */

import { h, notify, number } from "../dom.js";
import { amountsCell } from "../materials.js";
import { baseName, names } from "../plan.js";
import { saidOfProblem } from "../said.js";
import { get } from "../state.js";
import { t, tn, tNodes } from "../texts.js";
import { brought } from "./doing.js";
import { tell } from "./outbox.js";
import { told } from "./wording.js";

const SAYS = {
  open: t("Waits for an answer"),
  accepted: t("Was accepted"),
  refused: t("Was refused"),
  outdated: t("Outdated: something has happened since, and another plan is looked for"),
};

/** The card of proposals. */
export class Proposals {
  /** @param {(number: number | null) => void} see shows a proposal on the map; null: the plan in force */
  constructor(see) {
    this.see = see;
    this.seen = null;
    this.drawn = null;
    this.says = h("p", { class: "hint", role: "status", "data-testid": "mission-planning" });
    this.place = h("div", { class: "block" });
    this.element = h("section", { class: "card", "aria-label": t("Proposals"), "data-testid": "mission-proposals" }, h("h3", {}, t("Proposals")), this.says, this.place);
  }

  /** @param {object} mission as the store has it */
  draw({ head, plan, proposals }) {
    const says = saysOf(head, proposals);
    if (this.says.textContent !== says) this.says.textContent = says;
    const open = proposals.find(({ status }) => status === "open");
    if (this.seen !== null && this.seen !== open?.number) this.show(null);
    const key = JSON.stringify([head.id, plan.number, this.seen, proposals.map(({ number: n, status }) => [n, status])]);
    if (this.drawn === key) return;
    this.drawn = key;
    const others = proposals.filter((each) => each !== open);
    this.place.replaceChildren(...[
      open && this.#openOne(open, plan, head.state.problem),
      others.length > 0 && h("details", {}, h("summary", {}, tn(others.length, "{count} earlier", "{count} earlier")), h("ul", { class: "log" }, others.map((each) =>
        h("li", { dataset: { proposal: each.number, status: each.status } }, tNodes("Plan {plan}, gained {reward}.", { plan: each.number, reward: number(each.gained) }), " ", h("span", { class: "hint" }, `${SAYS[each.status]}.`))))),
    ].filter(Boolean));
  }

  /** Show a proposal on the map, or the plan in force. */
  show(number_) {
    this.seen = number_;
    this.drawn = null;
    this.see(number_);
  }

  #openOne(proposal, plan, problem) {
    const nameOf = names(problem.targets);
    const place = (stop) => (stop.target_id ? nameOf(stop.target_id) : baseName(stop.base_id));
    const list = (stops) => (stops.length ? stops.map(place).join(" → ") : t("home"));
    const { uavs, visits_changed: changed } = proposal.differences;
    const [now, then] = [brought(plan), brought(proposal)];
    const moved = problem.targets.filter(({ id }) => String(now.get(id)) !== String(then.get(id)));
    const nothing = problem.targets[0].loadlist.map(() => 0);
    const act = (title, type, look) => h("button", { type: "button", class: look, onclick: (event) => void this.#answer(event.target, type, proposal.number) }, title);
    const seen = h("button", { type: "button", "aria-pressed": String(this.seen === proposal.number), onclick: () => this.show(this.seen === proposal.number ? null : proposal.number) }, t("Show it on the map"));
    return h("div", { class: "block", dataset: { proposal: proposal.number, status: "open" } },
      h("p", {}, tNodes("Plan {plan} earns {reward} more than the plan in force, and changes {visits}.", { plan: proposal.number, reward: h("strong", {}, number(proposal.gained)), visits: tn(changed, "{count} visit", "{count} visits") })),
      h("div", { class: "row" }, act(t("Accept"), "proposal_accepted", "primary"), act(t("Refuse"), "proposal_refused", ""), seen),
      h("details", { open: true }, h("summary", {}, tn(uavs.length, "Stops of {count} UAV", "Stops of {count} UAVs")),
        h("table", { "data-testid": "proposal-stops" }, head([t("UAV"), t("In force"), t("Proposed")]), h("tbody", {}, uavs.map((each) =>
          h("tr", { dataset: { uav: each.uav_id } }, h("th", { scope: "row" }, each.uav_id), h("td", { class: "wide" }, list(each.before)), h("td", { class: "wide" }, list(each.after))))))),
      h("details", {}, h("summary", {}, tn(moved.length, "What {count} area gets", "What {count} areas get")),
        h("table", { "data-testid": "proposal-areas" }, head([t("Area"), t("In force"), t("Proposed")]), h("tbody", {}, moved.map(({ id }) =>
          h("tr", { dataset: { area: id } }, h("th", { scope: "row" }, nameOf(id)), h("td", {}, amountsCell(problem, now.get(id) ?? nothing)), h("td", {}, amountsCell(problem, then.get(id) ?? nothing))))))));
  }

  async #answer(button, type, proposal) {
    button.disabled = true;
    try {
      const answer = await tell(get().openMission.id, { type, proposal });
      notify(answer ? told(answer) : t("It could not be sent, and is kept: send it again below"), answer ? "info" : "error");
    } catch (error) {
      notify(error.message, "error");
    } finally {
      button.disabled = false;
    }
  }
}

function head(titles) {
  return h("thead", {}, h("tr", {}, titles.map((title) => h("th", { scope: "col" }, title))));
}

function saysOf({ searching, trouble, planning }, proposals) {
  if (trouble) return t("The newest search failed: {why}. The plan in force stays.", { why: saidOfProblem(trouble) });
  if (searching) return t("{algorithm} looks for a better plan.", { algorithm: planning.algorithm });
  if (proposals.some(({ status }) => status === "open")) return t("A better plan was found.");
  return planning.plans === "automatic" ? t("Better plans take effect by themselves.") : t("No better plan is known.");
}
