/** The map: the reason of loss of every rotation along the path, the plan's course, and ghosts. */

import { byId, el } from "../dom.js";
import { deg } from "../format.js";
import { Bands, courseAt } from "./bands.js";
import { Chart } from "./chart.js";
import { Choices } from "./choices.js";
import { Gestures } from "./gestures.js";
import { Grid } from "./grid.js";
import { Hover } from "./hover.js";
import { legend } from "./legend.js";
import { Pins } from "./pins.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../player.js").Player} Player */
/** @typedef {import("./hover.js").Cell} Cell */

export class MapView {
  /**
   * @param {Store} store
   * @param {Player} player
   * @param {{send: (message: any) => boolean}} connection
   * @param {import("./hover.js").Haunt} haunt
   */
  constructor(store, player, connection, haunt) {
    this.store = store;
    this.player = player;
    this.connection = connection;
    this.canvas = byId("map-canvas", HTMLCanvasElement);
    this.chart = new Chart(this.canvas);
    this.pins = new Pins(store, connection);
    const again = () => this.invalidate();
    this.bands = new Bands(this.chart, this.pins, () => {
      if (this.bands.busy) this.hover.leave();
      this.describe();
      this.invalidate();
    });
    this.gestures = new Gestures(this.chart, again);
    this.choices = new Choices(store, connection, () => this.load());
    this.hover = new Hover(store, this.chart, this.choices, connection, haunt, again);
    this.said = byId("map-state");
    this.legend = byId("legend");
    this.tabs = byId("postures");
    /** @type {Grid | null} */
    this.grid = null;
    this.layer = 0;
    this.picked = false; // by hand; else the layer follows the course
    this.asked = "";
    this.waiting = false;
    this.bind();
    this.load();
  }

  bind() {
    const { store, player, canvas, hover } = this;
    store.on(["selected"], () => {
      this.picked = false;
      hover.leave();
      this.load();
    });
    store.on(["map", "plan", "scene", "job", "connection", "progress", "compare"], () =>
      this.load(),
    );
    store.on(["shade", "technique"], () => this.load());
    player.on(() => this.invalidate());
    new ResizeObserver(() => this.invalidate()).observe(canvas);
    canvas.addEventListener("pointermove", (event) => {
      const cell = hover.at(event.offsetX, event.offsetY);
      if (cell && !this.bands.busy && !this.gestures.drag) hover.enter(cell);
      else hover.leave();
    });
    canvas.addEventListener("pointerleave", () => hover.leave());
    canvas.addEventListener("blur", () => hover.leave());
    canvas.addEventListener("click", (event) => {
      const cell = hover.at(event.offsetX, event.offsetY);
      if (cell && !this.bands.took && !event.shiftKey) this.go(cell);
    });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /** Take the data of the chosen contour; ask for its map unless it belongs to the plan. */
  load() {
    const { store } = this;
    const { selected } = store;
    const plans = (selected && store.plans.get(selected)) || [];
    const nopath = selected ? store.nopaths.get(selected) : undefined;
    const graph = plans[0]?.graph ?? nopath?.graph ?? null;
    const map = selected ? store.maps.get(selected) : undefined;
    const key = `${selected} ${graph} ${store.connection}`;
    if (
      selected &&
      graph &&
      map?.graph !== graph &&
      this.asked !== key &&
      store.connection === "open"
    ) {
      this.asked = key;
      this.connection.send({ type: "map", contour: selected });
    }
    if (map && this.grid?.message !== map) {
      this.grid = new Grid(map);
      this.layer = Math.min(this.layer, Math.max(0, this.grid.layers.length - 1));
    } else if (!map) this.grid = null;
    if (this.grid && !this.picked) {
      const wanted = this.grid.layerOf(plans[0]?.posture[0] ?? -1);
      if (wanted >= 0) this.layer = wanted;
    }
    this.choices.load(this.grid);
    this.hand();
    this.describe();
    this.invalidate();
  }

  /** Give the chart its data. */
  hand() {
    const { chart, grid, layer, choices } = this;
    Object.assign(chart, { grid, layer, shade: choices.shade });
    this.gestures.recall();
  }

  /** Draw the tabs, the legend, or a text if there is no map. */
  describe() {
    const { grid, store } = this;
    const busy = store.progress.busy || store.connection !== "open";
    this.said.replaceChildren(
      ...(grid
        ? grid.layers.length
          ? []
          : [
              el("strong", {}, "No rotation is admitted"),
              el("p", {}, grid.message.hidden.join("; ")),
            ]
        : [
            ...(busy ? [el("div", { class: "spinner" })] : []),
            el(
              "p",
              {},
              busy
                ? "The map appears with the first plan of this contour."
                : "Choose a contour to see its map.",
            ),
          ]),
    );
    this.tabs.replaceChildren(
      ...(grid && grid.layers.length > 1
        ? grid.layers.map(({ name }, i) =>
            el(
              "button",
              { "aria-pressed": String(i === this.layer), onclick: () => this.show(i) },
              name,
            ),
          )
        : []),
    );
    byId("map-said").textContent = grid?.layers.length === 1 ? grid.layers[0].name : "";
    if (!grid || !grid.layers.length) return this.legend.replaceChildren(...this.bands.listed());
    this.hand();
    this.legend.replaceChildren(
      ...this.choices.legend(grid),
      ...legend(grid, this.layer, this.chart.inks(), {
        course: store.plans.has(grid.message.contour),
        before: store.besideOf(grid.message.contour),
        shaded: this.choices.shade !== null,
      }),
      ...this.bands.listed(),
    );
  }

  /** @param {number} layer */
  show(layer) {
    this.layer = layer;
    this.picked = true;
    this.describe();
    this.invalidate();
  }

  invalidate() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  draw() {
    const { store, chart } = this;
    this.hand();
    const name = store.selected ?? "";
    const plans = store.plans.get(name) ?? [];
    const { moment } = this.player;
    const cutting = moment?.span.plan?.contour === name ? moment : null;
    const plan = cutting?.span.plan;
    const k = Math.min(cutting?.node ?? 0, (plan?.s.length ?? 1) - 1);
    chart.draw({
      plans,
      before: store.beside(name),
      technique: this.choices.course,
      stale: plans.some((each) => store.stale(each)),
      broken: store.nopaths.get(name)?.s ?? null,
      now: plan ? { s: plan.s[k], gamma: plan.gamma[k] } : null,
      hover: this.hover.cell,
      under: (context, frame) => this.bands.draw(context, frame),
    });
  }

  /**
   * Go to the node of the plan at this path length.
   * @param {Cell} cell
   */
  go({ node }) {
    const { store, grid, player } = this;
    const s = grid?.message.s[node] ?? 0;
    for (const plan of store.plans.get(store.selected ?? "") ?? []) {
      if (s < plan.s[0] - 1e-9 || s > plan.s[plan.s.length - 1] + 1e-9) continue;
      let k = plan.s.findIndex((each) => each >= s - 1e-9);
      if (k < 0) k = plan.s.length - 1;
      const when = player.timeline.when(plan, k);
      if (when !== null) player.seek(when);
      return;
    }
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const { grid, hover, gestures } = this;
    if (!grid || !grid.layers.length) return;
    const plain = !event.ctrlKey && !event.metaKey && !event.altKey;
    if ((plain && this.pinned(event)) || gestures.key(event, this.middle())) {
      event.preventDefault();
      event.stopPropagation();
      return;
    }
    if (!plain) return;
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const move = moves[/** @type {keyof typeof moves} */ (event.key)];
    if (event.key === "Escape") hover.leave();
    if (event.key === "Enter" && hover.cell) this.go(hover.cell);
    if (!move) return;
    const plan = this.store.plans.get(grid.message.contour)?.[0];
    const from = hover.cell ?? { node: 0, sample: grid.sampleAt(plan?.gamma[0] ?? 0) };
    const stride = event.shiftKey ? 10 : 1;
    const node = Math.min(Math.max(from.node + move[0] * stride, 0), grid.nodes - 1);
    const sample = (from.sample + move[1] * stride + 10 * grid.samples) % grid.samples;
    const { s, gamma } = grid.message;
    gestures.show((s[node] - s[0]) / grid.length, 0.5 - deg(gamma[sample]) / 360);
    hover.enter({ node, sample });
    event.preventDefault();
    event.stopPropagation();
  }

  /** Return the place that keys zoom about: the cursor, else the middle of the view. */
  middle() {
    const { cell } = this.hover;
    const { message } = /** @type {Grid} */ (this.grid);
    if (!cell) return { x: 0.5, y: 0.5 };
    const frame = this.chart.frame();
    const [offsetX, offsetY] = [
      this.chart.x(message.s[cell.node], frame),
      this.chart.y(message.gamma[cell.sample], frame),
    ];
    return this.gestures.share({ offsetX, offsetY });
  }

  /**
   * Pass a key to the pins; return whether they used it.
   * @param {KeyboardEvent} event
   */
  pinned(event) {
    const { message } = /** @type {Grid} */ (this.grid);
    const { cell } = this.hover;
    const node = cell?.node ?? 0;
    const course = courseAt(this.store.plans.get(message.contour) ?? [], message.s[node]);
    const here = cell ? deg(message.gamma[cell.sample]) : null;
    return this.bands.key(event, node, course ?? here);
  }

  /** Take the colours of the theme. */
  paint() {
    this.chart.painted = "";
    this.describe();
    this.invalidate();
  }
}
