/** The cursor of the map: the reason of loss of a pose, its numbers, and its ghost. */

import { send, store } from "../app.js";
import { byId } from "../dom.js";
import { capital, degrees, millimetres } from "../format.js";
import { turnedAbout } from "../inverse.js";
import { draw, html } from "../ui.js";
import { wrapped } from "./grid.js";

/** @typedef {import("./chart.js").Chart} Chart */
/** @typedef {import("./choices.js").Choices} Choices */
/** @typedef {{node: number, sample: number}} Cell */
/** @typedef {(q: ArrayLike<number> | null, admitted: boolean) => void} Haunt */

const ASK_AFTER = 140; // ms at rest before the server is asked for details

export class Hover {
  /**
   * @param {Chart} chart
   * @param {Choices} choices
   * @param {Haunt} haunt
   * @param {() => void} changed
   */
  constructor(chart, choices, haunt, changed) {
    this.chart = chart;
    this.choices = choices;
    this.haunt = haunt;
    this.changed = changed;
    this.tip = byId("map-tip");
    /** @type {Cell | null} */
    this.cell = null;
    this.timer = 0;
    store.on(["pose"], (pose) => this.answered(pose));
  }

  /** The grid that is hovered. */
  get grid() {
    return /** @type {import("./grid.js").Grid} */ (this.chart.grid);
  }

  /**
   * Return the cell at a place of the canvas, or null.
   * @param {number} x
   * @param {number} y
   * @returns {Cell | null}
   */
  at(x, y) {
    const { chart, grid } = this;
    if (!chart.grid?.layers.length) return null;
    const { left, top, width, height } = chart.frame;
    if (x < left || x > left + width || y < top || y > top + height) return null;
    const gamma = (chart.gammaAt(y) / 180) * Math.PI;
    return { node: grid.nodeAt(chart.sAt(x)), sample: grid.sampleAt(gamma) };
  }

  /**
   * Show the reason of a pose, and its ghost.
   * @param {Cell} cell
   */
  enter(cell) {
    const { grid, chart } = this;
    this.cell = cell;
    const code = grid.code(chart.layer, cell.node, cell.sample);
    const admitted = grid.message.kinds[code] === "admitted";
    const q = this.turned(cell);
    this.haunt(q, admitted);
    this.say(
      admitted ? "free" : `lost: ${grid.message.reasons[code]}`,
      this.numbers(grid.message.reasons[code], q),
    );
    this.changed();
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      const { posture } = grid.layers[chart.layer];
      const gamma = grid.message.gamma[cell.sample];
      const { contour } = grid.message;
      send({ type: "reason", contour, node: cell.node, gamma, posture });
    }, ASK_AFTER);
  }

  /**
   * Return the joints of a pose by turning the plan's pose at its node about the beam; null if the
   * plan is in another posture or the iteration fails: the server's answer shows it then.
   * @param {Cell} cell
   */
  turned({ node, sample }) {
    const { scene, plans } = store;
    const { s, gamma, contour } = this.grid.message;
    const { posture } = this.grid.layers[this.chart.layer];
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
   * Return the numbers of a reason that follow from the joints.
   * @param {string} words
   * @param {ArrayLike<number> | null} q
   */
  numbers(words, q) {
    const joints = store.scene?.robot.joints;
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
    // Only joints of the arm: the cursor does not move external axes.
    let [nearest, room] = [-1, Infinity];
    joints.forEach(({ lower, upper, endless, carries }, i) => {
      if (endless || carries || lower === null || upper === null) return;
      const left = Math.min(q[i] - lower, upper - q[i]);
      if (left >= 0 && left < room) [nearest, room] = [i, left];
    });
    return nearest < 0 ? "" : `nearest limit: joint ${nearest + 1}, ${degrees(room)} away`;
  }

  /**
   * Write the tip beside the cursor.
   * @param {string} head
   * @param {string} numbers
   */
  say(head, numbers) {
    const { cell, chart, tip, grid } = this;
    if (!cell || !chart.grid) return;
    const s = grid.message.s[cell.node];
    const gamma = grid.message.gamma[cell.sample];
    const place = cell.node * grid.samples + cell.sample;
    const [{ posture }, { shade }] = [grid.layers[chart.layer], this.choices];
    const shaded = shade?.said(posture, place) ?? "";
    if (head === "free" && shade?.tooNear(posture, place)) head = "closer than allowed";
    draw(
      tip,
      html`
        <b>${capital(head)}</b>
        ${[shaded, numbers].map((each) => each && html`<span>${each}</span><br />`)}
        <span class="quiet">
          ${millimetres(s - grid.message.s[0])}, gamma ${degrees(gamma, 0)}
        </span>`,
    );
    tip.hidden = false;
    const { clientWidth, clientHeight } = chart.canvas;
    const [x, y] = [chart.x(s), chart.y(gamma)];
    const left = x + 16 + tip.offsetWidth > clientWidth ? x - 16 - tip.offsetWidth : x + 16;
    const top = Math.min(
      Math.max(4, y - tip.offsetHeight / 2),
      clientHeight - tip.offsetHeight - 4,
    );
    tip.style.transform = `translate(${Math.max(0, left)}px, ${top}px)`;
  }

  /** @param {import("../messages.js").PoseMessage} pose */
  answered(pose) {
    const { cell, chart, grid } = this;
    if (!cell || !chart.grid) return;
    const { posture } = grid.layers[chart.layer];
    const here = [grid.message.contour, cell.node, cell.sample, posture].join(" ");
    const there = [pose.contour, pose.node, grid.sampleAt(pose.gamma), pose.posture].join(" ");
    if (here !== there) return;
    this.haunt(pose.q, pose.admitted);
    const [head, rest] = pose.reason.split(/: (.*)/s);
    const numbers = rest ?? this.numbers(head, pose.q);
    this.say(pose.admitted ? "free" : `lost: ${head}`, numbers);
  }

  leave() {
    clearTimeout(this.timer);
    if (this.cell) this.haunt(null, true);
    this.cell = null;
    this.tip.hidden = true;
    this.changed();
  }
}
