/** The views, each registered by its own module in views/. */

const views = new Map();

/**
 * Register a view.
 * @param {{id: string, title: string, order: number, layout: "panel" | "page",
 *   mount: (root: HTMLElement, context: {map: object, dock: HTMLElement}) => void,
 *   show?: () => void, hide?: () => void}} view
 *   `panel` stands beside the map and may fill `context.dock` below it; `page` takes the whole width.
 *   `mount` is called once, before the view is first shown.
 */
export function registerView(view) {
  views.set(view.id, { dock: null, ...view });
}

/** All views in their order. */
export function allViews() {
  return [...views.values()].sort((a, b) => a.order - b.order);
}
