/** The map: the reason of loss of every rotation along the path, the plan's course, and ghosts. */

import { player, send, store } from "../app.js";
import { ARROWS, byId, onNextFrame } from "../dom.js";
import { deg } from "../format.js";
import { posturePicture } from "../posture.js";
import { html, mount, redraw, segments } from "../ui.js";
import { Bands, courseAt } from "./bands.js";
import { Chart } from "./chart.js";
import { Choices } from "./choices.js";
import { Gestures } from "./gestures.js";
import { Grid } from "./grid.js";
import { Hover } from "./hover.js";
import { legend } from "./legend.js";
import { Pins } from "./pins.js";

/** @typedef {import("./hover.js").Cell} Cell */

/** @param {string} name */
const pictured = (name) => html`${posturePicture(name)}${name}`;

export class MapView {
  /** @param {import("./hover.js").Haunt} haunt */
  constructor(haunt) {
    this.canvas = byId("map-canvas", HTMLCanvasElement);
    this.chart = new Chart(this.canvas);
    this.pins = new Pins();
    this.invalidate = onNextFrame(() => this.draw());
    this.bands = new Bands(this.chart, this.pins, () => {
      if (this.bands.busy) this.hover.leave();
      redraw();
      this.invalidate();
    });
    this.gestures = new Gestures(this.chart, this.invalidate);
    this.choices = new Choices(() => this.load());
    this.hover = new Hover(this.chart, this.choices, haunt, this.invalidate);
    /** @type {Grid | null} */
    this.grid = null;
    this.layer = 0;
    this.picked = false; // by hand; else the layer follows the course
    this.asked = "";
    this.bind();
    this.load();
    mount(byId("postures"), () => this.tabs());
    mount(byId("map-said"), () => this.grid?.layers.length === 1 && this.grid.layers[0].name);
    mount(byId("map-state"), () => this.state());
    mount(byId("map-choices"), () => this.choices.lists(this.grid));
    mount(byId("legend"), () => this.legend());
  }

  bind() {
    const { canvas, hover } = this;
    store.on(["selected"], () => {
      this.picked = false;
      hover.leave();
      this.load();
    });
    store.on(["map", "plan", "scene", "job", "connection", "progress"], () => this.load());
    store.on(["compare", "shade", "technique"], () => this.load());
    player.on(this.invalidate);
    new ResizeObserver(this.invalidate).observe(canvas);
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
    const { selected, chosen: plans } = store;
    const graph = (plans[0] ?? store.nopaths.get(selected ?? ""))?.graph;
    const map = store.maps.get(selected ?? "");
    const key = `${selected} ${graph} ${store.connection}`;
    if (selected && graph && map?.graph !== graph && this.asked !== key) {
      if (send({ type: "map", contour: selected })) this.asked = key;
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
    redraw();
    this.invalidate();
  }

  /** Give the chart its data. */
  hand() {
    const { chart, grid, layer, choices } = this;
    Object.assign(chart, { grid, layer, shade: choices.shade });
    this.gestures.recall();
  }

  /** Buttons for the postures. */
  tabs() {
    const layers = this.grid?.layers ?? [];
    if (layers.length < 2) return null;
    const choices = layers.map(({ name }, i) => ({ value: String(i), label: pictured(name) }));
    return segments("Posture", choices, String(this.layer), (layer) => this.show(Number(layer)));
  }

  /** A text if there is no map. */
  state() {
    const { grid } = this;
    if (grid?.layers.length) return null;
    if (grid)
      return html`
        <strong>No rotation is admitted</strong>
        <p>${grid.message.hidden.join("; ")}</p>`;
    return store.progress.busy || store.connection !== "open"
      ? html`<div class="spinner" /><p>The map appears with the first plan of this contour.</p>`
      : html`<p>${store.selected ? "No map: this contour is not planned." : "Choose a contour to see its map."}</p>`;
  }

  legend() {
    const { grid, layer, chart, choices } = this;
    if (!grid?.layers.length) return this.bands.listed();
    this.hand();
    const { contour } = grid.message;
    const lines = {
      course: store.plans.has(contour),
      before: store.besideOf(contour),
      shaded: choices.shade !== null,
    };
    return html`
      ${choices.legend(grid)}${legend(grid, layer, chart.inks(), lines)}${this.bands.listed()}`;
  }

  /** @param {number} layer */
  show(layer) {
    this.layer = layer;
    this.picked = true;
    this.invalidate();
  }

  draw() {
    const { chart } = this;
    this.hand();
    const { chosen: plans } = store;
    const name = store.selected ?? "";
    const { moment } = player;
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
      under: (context) => this.bands.draw(context),
    });
  }

  /**
   * Go to the node of the plan at this path length.
   * @param {Cell} cell
   */
  go({ node }) {
    const { grid } = this;
    const s = grid?.message.s[node] ?? 0;
    for (const plan of store.chosen) {
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
    const move = ARROWS[event.key];
    if (event.key === "Escape") hover.leave();
    if (event.key === "Enter" && hover.cell) this.go(hover.cell);
    if (!move) return;
    const plan = store.plans.get(grid.message.contour)?.[0];
    const from = hover.cell ?? { node: 0, sample: grid.sampleAt(plan?.gamma[0] ?? 0) };
    const stride = event.shiftKey ? 10 : 1;
    const node = Math.min(Math.max(from.node + move[0] * stride, 0), grid.nodes - 1);
    const sample = (from.sample - move[1] * stride + 10 * grid.samples) % grid.samples;
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
    const offsetX = this.chart.x(message.s[cell.node]);
    const offsetY = this.chart.y(message.gamma[cell.sample]);
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
    const course = courseAt(store.plans.get(message.contour) ?? [], message.s[node]);
    const here = cell ? deg(message.gamma[cell.sample]) : null;
    return this.bands.key(event, node, course ?? here);
  }

  /** Take the colours of the theme. */
  paint() {
    this.chart.painted = "";
    this.invalidate();
  }
}
