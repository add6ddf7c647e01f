/** The map: what became of every rotation along the path, the course through it, and its ghosts. */

import { byId, el } from "../dom.js";
import { deg, degrees, fixed } from "../format.js";
import { Bands, courseAt } from "./bands.js";
import { Chart } from "./chart.js";
import { turnedAbout } from "../inverse.js";
import { Grid, wrapped } from "./grid.js";
import { legend } from "./legend.js";
import { Pins } from "./pins.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../player.js").Player} Player */
/** @typedef {{node: number, sample: number}} Cell */
/** @typedef {(q: ArrayLike<number> | null, admitted: boolean) => void} Haunt */

const ASK_AFTER = 140; // ms at rest, before the server is asked for more than the map says

export class MapView {
  /**
   * @param {Store} store
   * @param {Player} player
   * @param {{send: (message: any) => boolean}} connection
   * @param {Haunt} haunt
   */
  constructor(store, player, connection, haunt) {
    this.store = store;
    this.player = player;
    this.connection = connection;
    this.haunt = haunt;
    this.canvas = byId("map-canvas", HTMLCanvasElement);
    this.chart = new Chart(this.canvas);
    this.pins = new Pins(store, connection);
    this.bands = new Bands(this.chart, this.pins, () => {
      if (this.bands.busy) this.leave();
      this.describe();
      this.invalidate();
    });
    this.tip = byId("map-tip");
    this.said = byId("map-state");
    this.legend = byId("legend");
    this.tabs = byId("postures");
    /** @type {Grid | null} */
    this.grid = null;
    this.layer = 0;
    this.picked = false; // by hand; else the layer follows the course
    this.asked = "";
    /** @type {Cell | null} */
    this.hover = null;
    this.timer = 0;
    this.waiting = false;
    this.bind();
    this.load();
  }

  bind() {
    const { store, player, canvas } = this;
    store.on(["selected"], () => {
      this.picked = false;
      this.leave();
      this.load();
    });
    store.on(["map", "plan", "scene", "job", "connection", "progress", "compare"], () =>
      this.load(),
    );
    store.on(["pose"], (pose) => this.answered(pose));
    player.on(() => this.invalidate());
    new ResizeObserver(() => this.invalidate()).observe(canvas);
    canvas.addEventListener("pointermove", (event) => {
      const cell = this.cellAt(event.offsetX, event.offsetY);
      if (cell && !this.bands.busy) this.enter(cell);
      else this.leave();
    });
    canvas.addEventListener("pointerleave", () => this.leave());
    canvas.addEventListener("blur", () => this.leave());
    canvas.addEventListener("click", (event) => {
      const cell = this.cellAt(event.offsetX, event.offsetY);
      if (cell && !this.bands.took) this.go(cell);
    });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /** Take what is known of the chosen contour; ask for its map where it is not that of its plan. */
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
    this.describe();
    this.invalidate();
  }

  /** Draw the tabs, the legend and what stands in for a map. */
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
    Object.assign(this.chart, { grid, layer: this.layer });
    this.legend.replaceChildren(
      ...legend(grid, this.layer, this.chart.inks(), {
        course: store.plans.has(grid.message.contour),
        before: store.besideOf(grid.message.contour),
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
    const { store, chart, grid, layer } = this;
    Object.assign(chart, { grid, layer });
    const name = store.selected ?? "";
    const plans = store.plans.get(name) ?? [];
    const { moment } = this.player;
    const cutting = moment?.span.plan?.contour === name ? moment : null;
    const plan = cutting?.span.plan;
    const k = Math.min(cutting?.node ?? 0, (plan?.s.length ?? 1) - 1);
    chart.draw({
      plans,
      before: store.beside(name),
      stale: plans.some((each) => store.stale(each)),
      broken: store.nopaths.get(name)?.s ?? null,
      now: plan ? { s: plan.s[k], gamma: plan.gamma[k] } : null,
      hover: this.hover,
      under: (context, frame) => this.bands.draw(context, frame),
    });
  }

  /**
   * Return the cell at a place of the canvas, or null.
   * @param {number} x
   * @param {number} y
   * @returns {Cell | null}
   */
  cellAt(x, y) {
    const { grid } = this;
    if (!grid || !grid.layers.length) return null;
    const { left, top, width, height } = this.chart.frame();
    const [across, down] = [(x - left) / width, (y - top) / height];
    if (across < 0 || across > 1 || down < 0 || down > 1) return null;
    return {
      node: grid.nodeAt(grid.message.s[0] + across * grid.length),
      sample: grid.sampleAt(Math.PI * (1 - 2 * down)),
    };
  }

  /**
   * Say what became of a pose, and show it as a ghost.
   * @param {Cell} cell
   */
  enter(cell) {
    const grid = /** @type {Grid} */ (this.grid);
    this.hover = cell;
    const code = grid.code(this.layer, cell.node, cell.sample);
    const admitted = grid.message.kinds[code] === "admitted";
    const q = this.turned(cell);
    this.haunt(q, admitted);
    this.say(
      admitted ? "free" : `lost: ${grid.message.reasons[code]}`,
      this.numbers(grid.message.reasons[code], q),
    );
    this.invalidate();
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      const { posture } = grid.layers[this.layer];
      const gamma = grid.message.gamma[cell.sample];
      const { contour } = grid.message;
      this.connection.send({ type: "reason", contour, node: cell.node, gamma, posture });
    }, ASK_AFTER);
  }

  /**
   * Return the joints of a pose by turning the plan's at its node about the beam; null where the
   * plan is in another posture or the robot cannot follow: then the server's answer shows it.
   * @param {Cell} cell
   */
  turned({ node, sample }) {
    const { scene, plans } = this.store;
    const grid = /** @type {Grid} */ (this.grid);
    const { s, gamma, contour } = grid.message;
    const { posture } = grid.layers[this.layer];
    for (const plan of scene ? (plans.get(contour) ?? []) : []) {
      const k = plan.s.findIndex((each) => Math.abs(each - s[node]) < 1e-7);
      if (k < 0 || plan.posture[k] !== posture || !scene) continue;
      const n = scene.robot.joints.length;
      const angle = wrapped(gamma[sample] - plan.gamma[k]);
      return turnedAbout(scene.robot, plan.q.slice(k * n, (k + 1) * n), angle);
    }
    return null;
  }

  /**
   * Return what a reason is in numbers, as far as the joints say it.
   * @param {string} words
   * @param {ArrayLike<number> | null} q
   */
  numbers(words, q) {
    const joints = this.store.scene?.robot.joints;
    if (!q || !joints) return "";
    const named = /^joint (\d+) (low|high)$/.exec(words);
    if (named) {
      const i = Number(named[1]) - 1;
      const [{ lower, upper }, at] = [joints[i], q[i]];
      const limit = named[2] === "low" ? lower : upper;
      return limit === null
        ? ""
        : `joint ${i + 1} at ${degrees(at)}, its limit is ${degrees(limit)}`;
    }
    let [nearest, room] = [-1, Infinity];
    joints.forEach(({ lower, upper, endless }, i) => {
      if (endless || lower === null || upper === null) return;
      const left = Math.min(q[i] - lower, upper - q[i]);
      if (left >= 0 && left < room) [nearest, room] = [i, left];
    });
    return nearest < 0 ? "" : `nearest limit: joint ${nearest + 1}, ${degrees(room)} away`;
  }

  /**
   * Write the tip beside the hovered cell.
   * @param {string} head
   * @param {string} numbers
   */
  say(head, numbers) {
    const { hover, grid, tip } = this;
    if (!hover || !grid) return;
    const frame = this.chart.frame();
    const s = grid.message.s[hover.node];
    const gamma = grid.message.gamma[hover.sample];
    tip.replaceChildren(
      el("b", {}, head[0].toUpperCase() + head.slice(1)),
      ...(numbers ? [el("span", {}, numbers), el("br")] : []),
      el(
        "span",
        { class: "quiet" },
        `${fixed((s - grid.message.s[0]) * 1e3)} mm, gamma ${fixed(deg(gamma), 0)} deg`,
      ),
    );
    tip.hidden = false;
    const [x, y] = [this.chart.x(s, frame), this.chart.y(gamma, frame)];
    const left =
      x + 16 + tip.offsetWidth > this.canvas.clientWidth ? x - 16 - tip.offsetWidth : x + 16;
    const top = Math.min(
      Math.max(4, y - tip.offsetHeight / 2),
      this.canvas.clientHeight - tip.offsetHeight - 4,
    );
    tip.style.transform = `translate(${Math.max(0, left)}px, ${top}px)`;
  }

  /** @param {import("../messages.js").PoseMessage} pose */
  answered(pose) {
    const { hover, grid } = this;
    if (!hover || !grid || pose.contour !== grid.message.contour || pose.node !== hover.node)
      return;
    if (
      grid.sampleAt(pose.gamma) !== hover.sample ||
      pose.posture !== grid.layers[this.layer].posture
    )
      return;
    this.haunt(pose.q, pose.admitted);
    const [head, rest] = pose.reason.split(/: (.*)/s);
    const numbers = rest ?? this.numbers(head, pose.q);
    this.say(pose.admitted ? "free" : `lost: ${head}`, numbers);
  }

  leave() {
    clearTimeout(this.timer);
    if (this.hover) this.haunt(null, true);
    this.hover = null;
    this.tip.hidden = true;
    this.invalidate();
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
    const { grid } = this;
    if (!grid || !grid.layers.length || event.ctrlKey || event.metaKey || event.altKey) return;
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const move = moves[/** @type {keyof typeof moves} */ (event.key)];
    if (this.pinned(event)) return;
    if (event.key === "Escape") this.leave();
    if (event.key === "Enter" && this.hover) this.go(this.hover);
    if (!move) return;
    const plan = this.store.plans.get(grid.message.contour)?.[0];
    const from = this.hover ?? { node: 0, sample: grid.sampleAt(plan?.gamma[0] ?? 0) };
    const stride = event.shiftKey ? 10 : 1;
    this.enter({
      node: Math.min(Math.max(from.node + move[0] * stride, 0), grid.nodes - 1),
      sample: (from.sample + move[1] * stride + 10 * grid.samples) % grid.samples,
    });
    event.preventDefault();
    event.stopPropagation();
  }

  /**
   * Give a key to the pins; return whether it was one of theirs.
   * @param {KeyboardEvent} event
   */
  pinned(event) {
    const { message } = /** @type {Grid} */ (this.grid);
    const node = this.hover?.node ?? 0;
    const course = courseAt(this.store.plans.get(message.contour) ?? [], message.s[node]);
    const here = this.hover ? deg(message.gamma[this.hover.sample]) : null;
    if (!this.bands.key(event, node, course ?? here)) return false;
    event.preventDefault();
    event.stopPropagation();
    return true;
  }

  /** Take the colours of the theme. */
  paint() {
    this.chart.painted = "";
    this.describe();
    this.invalidate();
  }
}
