/** The drawing of a map on its canvas: cells, axes, courses, cursors. */

import { isDark } from "../desk.js";
import { freshContext, pixelRatio, textSize, themeColour } from "../dom.js";
import { deg, fixed } from "../format.js";
import { wrapped } from "./grid.js";
import { inks, pixels } from "./paint.js";
import { WHOLE } from "./window.js";

/** @typedef {import("../messages.js").PlanMessage} PlanMessage */
/** @typedef {import("../store.js").Course} Course */
/** @typedef {import("./grid.js").Grid} Grid */
/** @typedef {import("./shade.js").Shade} Shade */
/** @typedef {{left: number, top: number, width: number, height: number, em: number}} Frame CSS px */

/**
 * @typedef {object} Drawn
 * @property {PlanMessage[]} plans
 * @property {Course[]} before  drawn dashed
 * @property {Course | null} technique  drawn dotted
 * @property {boolean} stale
 * @property {number | null} broken  m, where the path breaks
 * @property {{s: number, gamma: number} | null} now
 * @property {{node: number, sample: number} | null} hover
 * @property {(context: CanvasRenderingContext2D) => void} under  draws what is below the courses
 */

const TURNS = [1, 2, 5, 10, 15, 30, 45, 90]; // deg
const STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000]; // mm

export class Chart {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    /** @type {Grid | null} */
    this.grid = null;
    this.layer = 0;
    /** @type {Shade | null} */
    this.shade = null;
    this.window = WHOLE;
    /** @type {HTMLCanvasElement} only the cells, painted when they change */
    this.back = document.createElement("canvas");
    this.painted = "";
    this.font = getComputedStyle(document.body).fontFamily;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    /** @type {Frame} where the cells are on the canvas */
    this.frame = this.measured();
    new ResizeObserver(() => (this.frame = this.measured())).observe(canvas);
  }

  inks() {
    const { message } = /** @type {Grid} */ (this.grid);
    return inks(message, isDark(), themeColour("--free"), this.shade !== null);
  }

  measured() {
    const em = textSize();
    const { clientWidth, clientHeight } = this.canvas;
    const [left, top] = [3.1 * em, 0.4 * em];
    return {
      ...{ left, top, em },
      width: Math.max(1, clientWidth - left - 0.6 * em),
      height: Math.max(1, clientHeight - top - 2.5 * em),
    };
  }

  /** @param {Drawn} drawn */
  draw({ plans, before, technique, stale, broken, now, hover, under }) {
    if (!freshContext(this.canvas) || !this.grid?.layers.length) return;
    this.frame = this.measured();
    const { context, frame } = this;
    const scale = frame.em / 13;
    this.cells();
    context.drawImage(this.back, frame.left, frame.top, frame.width, frame.height);
    this.axes();
    context.save();
    context.beginPath();
    context.rect(frame.left, frame.top, frame.width, frame.height);
    context.clip();
    under(context);
    context.setLineDash([5 * scale, 4 * scale]);
    for (const plan of before) this.stroke(plan, "--quiet", 1.6);
    if (technique) {
      context.lineCap = "round";
      context.setLineDash([0.1, 4.5 * scale]);
      this.stroke(technique, "--course-halo", 4.6);
      this.stroke(technique, "--other", 2.8);
      context.lineCap = "butt";
    }
    context.setLineDash([]);
    context.globalAlpha = stale ? 0.55 : 1;
    for (const plan of plans) {
      this.stroke(plan, "--course-halo", 4.84);
      this.stroke(plan, "--course", 2.2);
    }
    context.globalAlpha = 1;
    if (broken !== null) this.breakAt(broken);
    if (now) this.cursor(now);
    if (hover) this.crosshair(hover);
    context.restore();
  }

  /** Paint the cells if they, their size or the theme have changed. */
  cells() {
    const grid = /** @type {Grid} */ (this.grid);
    const ratio = pixelRatio();
    const { width, height } = this.frame;
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    const { graph, contour } = grid.message;
    const shaded = this.shade ? `${this.shade.message.by} ${this.shade.number}` : "";
    const { from, to, top, bottom } = this.window;
    const key = [graph, contour, this.layer, w, h, isDark(), shaded, from, to, top, bottom];
    if (key.join(" ") === this.painted) return;
    this.painted = key.join(" ");
    Object.assign(this.back, { width: w, height: h });
    const size = { width: w, height: h, period: Math.round(8 * ratio) };
    const image = pixels(grid, this.layer, this.inks(), size, this.window, this.shade);
    this.back.getContext("2d")?.putImageData(image, 0, 0);
  }

  /** @param {number} s  m */
  x(s) {
    const { message, length } = /** @type {Grid} */ (this.grid);
    const { from, to } = this.window;
    const { left, width } = this.frame;
    return left + (((s - message.s[0]) / length - from) / (to - from)) * width;
  }

  /**
   * Return the path length at a place, clamped to the window.
   * @param {number} x  px
   * @returns {number} m
   */
  sAt(x) {
    const { left, width } = this.frame;
    const { from, to } = this.window;
    const share = from + Math.min(1, Math.max(0, (x - left) / width)) * (to - from);
    return (this.grid?.message.s[0] ?? 0) + share * (this.grid?.length ?? 0);
  }

  /**
   * Return the rotation at a place, clamped to the window.
   * @param {number} y  px
   * @returns {number} deg
   */
  gammaAt(y) {
    const { top: edge, height } = this.frame;
    const { top, bottom } = this.window;
    const share = top + Math.min(1, Math.max(0, (y - edge) / height)) * (bottom - top);
    return 180 - 360 * share;
  }

  /**
   * Return the height of an angle from -180 to 180 deg.
   * @param {number} angle  deg
   */
  up(angle) {
    const { top, bottom } = this.window;
    return this.frame.top + ((0.5 - angle / 360 - top) / (bottom - top)) * this.frame.height;
  }

  /** @param {number} gamma  rad */
  y(gamma) {
    return this.up(deg(wrapped(gamma)));
  }

  axes() {
    const { length, message } = /** @type {Grid} */ (this.grid);
    const { context } = this;
    const { left, top, width, height, em } = this.frame;
    context.font = `${0.82 * em}px ${this.font}`;
    context.fillStyle = themeColour("--quiet");
    context.strokeStyle = themeColour("--rule");
    context.lineWidth = 1;
    context.strokeRect(left - 0.5, top - 0.5, width + 1, height + 1);
    context.textAlign = "right";
    context.textBaseline = "middle";
    const { from, to, top: high, bottom: low } = this.window;
    const turn = TURNS.find((each) => (360 * (low - high)) / each <= height / (1.5 * em)) ?? 90;
    for (let gamma = -180; gamma <= 180; gamma += turn) {
      const y = this.up(gamma);
      if (y < top - 0.5 || y > top + height + 0.5) continue;
      context.fillRect(left - 4, Math.round(y), 4, 1);
      const inside = Math.min(Math.max(y, top + 0.3 * em), top + height - 0.3 * em);
      context.fillText(fixed(gamma, 0), left - 0.5 * em, inside);
    }
    context.save();
    context.translate(0.55 * em, top + height / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = "center";
    context.fillText("gamma, deg", 0, 0);
    context.restore();
    context.textBaseline = "top";
    const mm = length * 1e3;
    const step = STEPS.find((each) => ((to - from) * mm) / each <= width / (4 * em)) ?? 2e4;
    for (let k = Math.ceil((from * mm) / step - 1e-9); k * step <= to * mm + 1e-9; k++) {
      const x = this.x(message.s[0] + (k * step) / 1e3);
      context.fillRect(Math.round(x), top + height, 1, 4);
      context.textAlign = x < left + em ? "left" : x > left + width - em ? "right" : "center";
      context.fillText(fixed(k * step, step < 1 ? 1 : 0), x, top + height + 0.4 * em);
    }
    context.textAlign = "center";
    context.fillText("path length, mm", left + width / 2, top + height + 1.4 * em);
  }

  /**
   * Draw a course; it is faint where its posture is not the shown one.
   * @param {Course} plan
   * @param {string} colour
   * @param {number} width  of the usual text size
   */
  stroke(plan, colour, width) {
    const { context } = this;
    const posture = this.grid?.layers[this.layer].posture;
    context.strokeStyle = themeColour(colour);
    context.lineWidth = (width * this.frame.em) / 13;
    context.lineJoin = "round";
    const alpha = context.globalAlpha;
    for (const here of [true, false]) {
      context.globalAlpha = here ? alpha : 0.3 * alpha;
      context.beginPath();
      for (let k = 0; k + 1 < plan.s.length; k++) {
        if ((plan.posture[k] === posture) !== here) continue;
        const [from, to] = [wrapped(plan.gamma[k]), wrapped(plan.gamma[k + 1])];
        if (Math.abs(from - to) > Math.PI) continue; // over the edge of the map
        context.moveTo(this.x(plan.s[k]), this.y(from));
        context.lineTo(this.x(plan.s[k + 1]), this.y(to));
      }
      context.stroke();
    }
    context.globalAlpha = alpha;
  }

  /**
   * Draw where the path breaks.
   * @param {number} s  m
   */
  breakAt(s) {
    const { context, frame } = this;
    const x = this.x(s);
    const width = (2 * frame.em) / 13;
    context.fillStyle = themeColour("--alert");
    context.fillRect(x - width / 2, frame.top, width, frame.height);
    context.font = `600 ${0.86 * frame.em}px ${this.font}`;
    context.textBaseline = "top";
    const right = x > frame.left + 0.7 * frame.width;
    context.textAlign = right ? "right" : "left";
    context.strokeStyle = themeColour("--course-halo");
    context.lineWidth = 4;
    const at = /** @type {const} */ ([x + (right ? -6 : 6), frame.top + 6]);
    context.strokeText("the path breaks here", ...at);
    context.fillText("the path breaks here", ...at);
  }

  /**
   * Draw the place of the player.
   * @param {{s: number, gamma: number}} now
   */
  cursor(now) {
    const { context, frame } = this;
    const scale = frame.em / 13;
    const [x, y] = [this.x(now.s), this.y(now.gamma)];
    context.fillStyle = themeColour("--kerf");
    context.fillRect(x - 0.75 * scale, frame.top, 1.5 * scale, frame.height);
    context.beginPath();
    context.arc(x, y, 4.5 * scale, 0, 7);
    context.fill();
    context.lineWidth = 1.5 * scale;
    context.strokeStyle = themeColour("--course-halo");
    context.stroke();
  }

  /**
   * Draw the place of the pointer.
   * @param {{node: number, sample: number}} hover
   */
  crosshair(hover) {
    const { context, frame } = this;
    const { message } = /** @type {Grid} */ (this.grid);
    const x = Math.round(this.x(message.s[hover.node]));
    const y = Math.round(this.y(message.gamma[hover.sample]));
    context.fillStyle = themeColour("--ink");
    context.globalAlpha = 0.5;
    context.fillRect(frame.left, y, frame.width, 1);
    context.fillRect(x, frame.top, 1, frame.height);
    context.globalAlpha = 1;
  }
}
