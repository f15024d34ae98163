/**
 * Zones of the mission that get another shape: the selected one is dragged on the map, by its corners or as a whole, or
 * changed as numbers. Nothing is told before the form says so, and then all zones that were changed are one event. Until
 * then the map has the zone as it is, filled, and as it will be, by its sides.
 */

import { h } from "../dom.js";
import { ZONES } from "../kinds.js";
import { called } from "../plan.js";
import { get, subscribe } from "../state.js";
import { tn } from "../texts.js";
import { ZoneCorners } from "../zone_corners.js";
import { cornersOf, faultOf } from "../zone_form.js";

/** The zones of a mission whose shape is being changed. */
export class ZoneShapes {
  /**
   * @param {object} map of the page; its handles of zones know where a position is drawn
   * @param {() => {state: object} | null} momentOf the moment on screen
   * @param {{begun: () => void, gone: () => void}} told of the first change, and when no zone is left that was changed
   */
  constructor(map, momentOf, { begun, gone }) {
    Object.assign(this, { map, momentOf, begun, gone, changed: new Map(), handles: null, shown: null, said: null });
    this.element = h("div", { class: "block" });
    subscribe(["selection", "view", "openMission"], () => this.draw());
  }

  /** All zones there are now, those that were changed with their new corners. @returns {object[]} */
  read() {
    return this.#zones().map((zone) => (this.changed.has(zone.id) ? { ...zone, polygon: this.changed.get(zone.id) } : zone));
  }

  /** Give up what was changed. */
  drop() {
    this.changed.clear();
    this.draw();
  }

  /** Show the selected zone as it will be. */
  draw() {
    const zones = this.read();
    // Another dispatcher may have opened a zone again.
    for (const id of this.changed.keys()) if (!zones.some((zone) => zone.id === id)) this.changed.delete(id);
    const { selection } = get();
    const chosen = this.#changeable() && selection?.kind === ZONES ? zones.find(({ id }) => id === selection.id) : null;
    // Each event brings all zones anew: the hand keeps what it holds while its zone is as it was.
    if (JSON.stringify(this.shown) !== JSON.stringify(chosen ?? null)) this.shown = chosen ?? null;
    this.#corners()?.show(this.shown, true, this.map.shift);
    if (!this.element.isConnected) return;
    if (this.changed.size) this.#say(zones.filter(({ id }) => this.changed.has(id)));
    else this.gone();
  }

  /** The zones that were changed; the corners of the selected one. */
  #say(zones) {
    const said = JSON.stringify([zones, this.shown]);
    if (this.said === said) return;
    this.said = said;
    const { crs } = get().openMission.head.state.problem;
    const line = (zone) => h("p", { dataset: { shape: zone.id } }, [tn(zone.polygon.length, "{zone} has {count} corner.", "{zone} has {count} corners.", { zone: called(zone) }), faultOf(zone, crs)].filter(Boolean).join(" "));
    const own = (zone) => [h("h5", {}, called(zone)), ...cornersOf(zone, { crs }, (polygon) => this.#change(zone.id, polygon))];
    this.element.replaceChildren(...zones.flatMap((zone) => (zone.id === this.shown?.id ? own(zone) : [line(zone)])));
  }

  #change(id, polygon) {
    const { polygon: now } = this.#zones().find((zone) => zone.id === id);
    if (JSON.stringify(now) === JSON.stringify(polygon)) this.changed.delete(id);
    else this.changed.set(id, polygon);
    if (this.changed.size && !this.element.isConnected) this.begun();
    this.draw();
  }

  /** Zones are changed as they are now, not as they were or are planned to be. */
  #changeable() {
    const { view, openMission: now } = get();
    return view === "missions" && Boolean(now?.head) && this.momentOf()?.state === now.head.state;
  }

  #zones() {
    return get().openMission?.head?.state.problem[ZONES] ?? [];
  }

  /** Handles on the map that there is: problems on a plane and on the globe have one each. */
  #corners() {
    if (this.handles?.map !== this.map.map) {
      this.handles = this.map.map && new ZoneCorners(this.map.map, { ...this.map.corners.options, changed: (id, polygon) => this.#change(id, polygon) });
    }
    return this.handles;
  }
}
