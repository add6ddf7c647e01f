/** A scatter plot of a Pareto set in two of its criteria, with a third one as colour. */

import { freshContext, textSize, themeColour } from "./dom.js";
import { digits, extent } from "./format.js";
import { alongScale } from "./scene/scale.js";

/** @typedef {{number: number, values: number[], best: boolean}} Point */
/** @typedef {{label: string}} Axis */

const NEAR = 14; // px within which a point is pointed at

/**
 * Return round numbers between two values.
 * @param {number} low
 * @param {number} high
 * @param {number} most
 */
export function ticks(low, high, most) {
  const rough = (high - low) / most;
  const unit = 10 ** Math.floor(Math.log10(rough));
  const step = unit * ([1, 2, 5, 10].find((each) => each * unit >= rough) ?? 10);
  const found = [];
  for (let at = Math.ceil(low / step) * step; at <= high + 1e-9 * step; at += step)
    found.push(Math.abs(at) < 1e-9 * step ? 0 : at);
  return found;
}

/**
 * Return the least and the largest of values, with some margin.
 * @param {number[]} values
 * @returns {[number, number]}
 */
function spanOf(values) {
  const [low, high] = extent(values);
  const room = 0.06 * (high - low) || Math.abs(low) * 0.05 || 1;
  return [low - room, high + room];
}

export class Scatter {
  constructor() {
    /** @type {HTMLCanvasElement | null} */
    this.canvas = null;
    /** @type {Point[]} */
    this.points = [];
    /** @type {[number, number][]} the range of each criterion, with some margin */
    this.spans = [];
    /** @type {[Axis, Axis]} */
    this.axes = [{ label: "" }, { label: "" }];
    /** @type {[number, number, number]} the criteria across, up, and by colour; -1: none */
    this.shown = [0, 1, -1];
    /** @type {number | null} the number of the point that is pointed at */
    this.hover = null;
    /** @type {number | null} that of the one whose motion is shown */
    this.chosen = null;
  }

  /**
   * Take the points of a set, in the units that are shown.
   * @param {import("./messages.js").FrontMessage} front
   * @param {(Axis & {of: (value: number) => number})[]} axes
   * @param {number | null} chosen
   */
  load({ points }, axes, chosen) {
    const [x, y, colour] = this.shown;
    const fits = (/** @type {number} */ axis, /** @type {number} */ other) =>
      axis < axes.length ? axis : other;
    this.shown = [fits(x, 0), fits(y, 1), fits(colour, -1)];
    this.points = points.map(({ number, values, best }) => ({
      ...{ number, best },
      values: values.map((value, i) => axes[i].of(value)),
    }));
    this.spans = axes.map((_, i) => spanOf(this.points.map((point) => point.values[i])));
    this.axes = [axes[this.shown[0]], axes[this.shown[1]]];
    this.chosen = chosen;
  }

  frame() {
    const em = textSize();
    const { clientWidth = 0, clientHeight = 0 } = this.canvas ?? {};
    const [left, top] = [3.6 * em, 0.5 * em];
    return {
      ...{ em, left, top },
      width: Math.max(1, clientWidth - left - 0.8 * em),
      height: Math.max(1, clientHeight - top - 2.7 * em),
    };
  }

  /**
   * Return where a point is on the canvas, CSS px.
   * @param {Point} point
   */
  place({ values }) {
    const { left, top, width, height } = this.frame();
    const [x, y] = this.shown;
    const [[x0, x1], [y0, y1]] = [this.spans[x], this.spans[y]];
    return {
      x: left + ((values[x] - x0) / (x1 - x0)) * width,
      y: top + (1 - (values[y] - y0) / (y1 - y0)) * height,
    };
  }

  /**
   * Return the point at a place, the best ones first, or null.
   * @param {number} x
   * @param {number} y
   */
  at(x, y) {
    let [found, nearest] = [/** @type {Point | null} */ (null), NEAR];
    for (const point of this.points) {
      const place = this.place(point);
      const away = Math.hypot(place.x - x, place.y - y) + (point.best ? 0 : 5);
      if (away < nearest) [found, nearest] = [point, away];
    }
    return found;
  }

  draw() {
    const context = this.canvas && freshContext(this.canvas);
    if (!context || !this.points.length) return;
    this.grid(context);
    const colour = this.shown[2];
    const [low, high] = colour < 0 ? [0, 1] : this.spans[colour];
    const { em } = this.frame();
    for (const best of [false, true])
      for (const point of this.points.filter((each) => each.best === best)) {
        const { x, y } = this.place(point);
        context.beginPath();
        context.arc(x, y, (best ? 0.36 : 0.2) * em, 0, 7);
        context.fillStyle = !best
          ? themeColour("--rule")
          : colour < 0
            ? themeColour("--accent")
            : alongScale((point.values[colour] - low) / (high - low)).getStyle();
        context.fill();
        context.lineWidth = 1;
        context.strokeStyle = themeColour(best ? "--panel" : "--rule");
        context.stroke();
      }
    this.ring(context, this.hover, "--ink", 1.5);
    this.ring(context, this.chosen, "--kerf", 2.5);
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {number | null} number
   * @param {string} colour
   * @param {number} width
   */
  ring(context, number, colour, width) {
    const point = this.points.find((each) => each.number === number);
    if (!point) return;
    const { x, y } = this.place(point);
    context.beginPath();
    context.arc(x, y, 0.55 * textSize(), 0, 7);
    context.lineWidth = width;
    context.strokeStyle = themeColour(colour);
    context.stroke();
  }

  /** @param {CanvasRenderingContext2D} context */
  grid(context) {
    const { left, top, width, height, em } = this.frame();
    context.font = `${0.82 * em}px ${getComputedStyle(document.body).fontFamily}`;
    context.fillStyle = themeColour("--quiet");
    context.strokeStyle = themeColour("--line");
    context.lineWidth = 1;
    const [[x0, x1], [y0, y1]] = this.shown.map((axis) => this.spans[axis]);
    context.textAlign = "center";
    context.textBaseline = "top";
    for (const at of ticks(x0, x1, width / (4.5 * em))) {
      const x = Math.round(left + ((at - x0) / (x1 - x0)) * width) + 0.5;
      context.strokeRect(x, top, 0, height);
      context.fillText(digits(at, 3), x, top + height + 0.35 * em);
    }
    context.fillText(this.axes[0].label, left + width / 2, top + height + 1.5 * em, width);
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const at of ticks(y0, y1, height / (2.5 * em))) {
      const y = Math.round(top + (1 - (at - y0) / (y1 - y0)) * height) + 0.5;
      context.strokeRect(left, y, width, 0);
      context.fillText(digits(at, 3), left - 0.4 * em, y);
    }
    context.save();
    context.translate(0.6 * em, top + height / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = "center";
    context.fillText(this.axes[1].label, 0, 0, height);
    context.restore();
  }
}
