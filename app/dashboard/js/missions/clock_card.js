/** The clock of a mission: look at another moment of it, move it on, or let it follow the clock on the wall. */

import { h, notify } from "../dom.js";
import { get } from "../state.js";
import { t } from "../texts.js";
import { allTimes, course } from "../times.js";
import { tell } from "./outbox.js";
import { follow, halt, onPace, pace } from "./pace.js";

const HOUR_S = 3600;

/** The card of the clock. */
export class ClockCard {
  /** @param {(at: number | null) => void} look shows another moment; null: the mission's clock */
  constructor(look) {
    this.look = look;
    this.at = 0;
    this.slider = h("input", { type: "range", min: "0", step: "any", "aria-label": t("Moment"), id: "mission-slider", oninput: () => this.#go(Number(this.slider.value)) });
    this.exact = h("input", { type: "number", min: "0", step: "any", "aria-label": t("Time"), id: "mission-time", onchange: () => this.#go(Number(this.exact.value)) });
    this.clock = h("output", { for: "mission-slider mission-time", "data-testid": "mission-clock" });
    this.says = h("p", { class: "hint", role: "status", "data-testid": "mission-moment" });
    this.advance = h("button", { type: "button", class: "primary", onclick: () => void this.#advance() }, t("Move the clock here"));
    this.now = h("button", { type: "button", class: "quiet", onclick: () => this.#go(null) }, t("Back to now"));
    this.seconds = h("input", { type: "number", min: "0.1", step: "any", name: "seconds" });
    this.follows = h("button", { type: "button", onclick: () => this.#follow() });
    this.trouble = h("p", { class: "error", role: "alert", hidden: true });
    onPace((trouble) => {
      this.trouble.textContent = trouble;
      this.trouble.hidden = !trouble;
      this.#drawPace();
    });
    this.unit = h("span", {});
    this.element = h("section", { class: "card", "aria-label": t("Clock") }, h("h3", {}, t("Clock")),
      h("p", { class: "clock" }, this.slider, this.exact, this.clock),
      h("div", { class: "row" }, h("button", { type: "button", onclick: () => this.#step(-1) }, t("Event before")), h("button", { type: "button", onclick: () => this.#step(1) }, t("Next event")), this.advance, this.now),
      this.says,
      h("label", { class: "line" }, this.unit, this.seconds), h("div", { class: "row" }, this.follows), this.trouble);
  }

  /** @param {object} mission as the store has it @param {number} at the moment on screen @param {string} says what is to be said of it */
  draw(mission, at, says) {
    const { head, plan } = mission;
    if (this.id !== mission.id) {
      this.id = mission.id;
      this.unit.textContent = head.state.problem.crs === "wgs84" ? t("An hour takes, s") : t("A unit of time takes, s");
      this.seconds.value = String(pace()?.mission === mission.id ? pace().seconds : HOUR_S);
    }
    const { moments } = course(head.state.problem, allTimes(head.state.problem, plan));
    this.moments = [...new Set([0, ...head.state.done.map(({ time }) => time), head.clock, ...moments])].sort((a, b) => a - b);
    const end = Math.max(this.moments.at(-1), at);
    this.at = at;
    const moved = document.activeElement;
    this.slider.max = String(end);
    if (moved !== this.slider || Number(this.slider.value) !== at) this.slider.value = String(at);
    if (moved !== this.exact) this.exact.value = String(Number(at.toPrecision(6)));
    const clock = { clock: head.clock, end };
    this.clock.textContent = head.state.problem.crs === "wgs84" ? t("{clock} of {end} h", clock) : t("{clock} of {end}", clock);
    this.advance.hidden = at <= head.clock;
    this.now.hidden = at === head.clock;
    if (this.says.textContent !== says) this.says.textContent = says;
    this.#drawPace();
  }

  #go(at) {
    this.look(at === null || at === get().openMission.head.clock ? null : Math.max(0, at || 0));
  }

  #step(way) {
    const next = way > 0 ? this.moments.find((at) => at > this.at + 1e-9) : this.moments.findLast((at) => at < this.at - 1e-9);
    if (next !== undefined) this.#go(next);
  }

  async #advance() {
    const { id } = get().openMission;
    try {
      await tell(id, { type: "clock", at: this.at });
      this.look(null);
    } catch (error) {
      notify(error.violations?.[0]?.detail ?? error.message, "error");
    }
  }

  #follow() {
    if (pace()?.mission === this.id) halt();
    else if (Number(this.seconds.value) > 0) follow(this.id, Number(this.seconds.value));
    else return notify(t("The clock needs a number of seconds above 0"), "error");
    this.#drawPace();
  }

  #drawPace() {
    const follows = pace()?.mission === this.id;
    this.follows.textContent = follows ? t("Halt the clock") : t("Follow the clock on the wall");
    this.follows.setAttribute("aria-pressed", String(follows));
    this.seconds.disabled = follows;
  }
}
