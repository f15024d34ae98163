/** Long lists in portions: the first elements are there, a button brings the next. */

import { h } from "./dom.js";
import { t } from "./texts.js";

const PORTION = 100;

/** Elements of a long list, made as they are asked for. */
export class Portions {
  /**
   * @param {HTMLElement} place what the elements go into
   * @param {any[]} items
   * @param {(item: any, at: number) => Node | Node[]} make
   * @param {(button: HTMLElement) => Node} [around] what the button stands in, such as a row of a table
   */
  constructor(place, items, make, around = (button) => button) {
    Object.assign(this, { place, items, make });
    this.count = 0;
    this.pinned = [];
    this.first = null;
    this.button = h("button", { type: "button", class: "quiet more", onclick: () => this.#next() });
    this.more = around(this.button);
    this.upTo(Math.min(PORTION, items.length));
  }

  /** Have the first so many. */
  upTo(count) {
    if (count > this.count) {
      const made = this.items.slice(this.count, count).flatMap((item, n) => this.make(item, this.count + n));
      this.more.remove();
      this.place.append(...made);
      this.first ??= made[0];
      this.count = Math.min(count, this.items.length);
    }
    const left = this.items.length - this.count;
    if (!left) return this.more.remove();
    this.button.textContent = t("Show {count} more of {all}", { count: Math.min(PORTION, left), all: left });
    this.place.append(this.more);
  }

  /** Have the one that a test finds, before all others where it was not there. @param {(item: any) => boolean} test */
  reveal(test) {
    for (const node of this.pinned) node.remove();
    const at = this.items.findIndex(test);
    this.pinned = at < this.count ? [] : [this.make(this.items[at], at)].flat();
    this.first?.before(...this.pinned);
  }

  #next() {
    const last = this.place.lastElementChild === this.more ? this.more.previousElementSibling : null;
    this.upTo(this.count + PORTION);
    // The button may be gone: what came first goes on from here.
    if (!this.button.isConnected) last?.nextElementSibling?.querySelector("button, input, a")?.focus();
  }
}
