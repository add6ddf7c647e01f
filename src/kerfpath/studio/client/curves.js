/** Curves of the joints over a cut: speed, acceleration, position; also those of another plan. */

import { themeColour } from "./dom.js";

/** @typedef {import("./messages.js").PlanMessage} PlanMessage */
/** @typedef {import("./axes.js").Axis} Axis */
/** @typedef {"speed" | "acceleration" | "angle"} Kind */

/**
 * Return the scale of the curve of an axis: %, deg or mm.
 * @param {Axis} axis
 * @param {Kind} kind
 */
export const scaleOf = ({ unit }, kind) => (kind === "angle" ? unit : "%");

/**
 * Return the columns to plot: time, then one per joint; a gap separates pieces.
 * @param {PlanMessage[]} plans
 * @param {Axis[]} axes
 * @param {Kind} kind
 * @returns {(number | null)[][]}
 */
export function columns(plans, axes, kind) {
  const joints = axes.length;
  /** @type {(number | null)[][]} */
  const out = Array.from({ length: joints + 1 }, () => []);
  let begin = 0;
  for (const { time, q, velocity_share, acceleration_share } of plans) {
    const [rows, offset, count] = {
      speed: /** @type {const} */ ([velocity_share, 0.5, time.length - 1]),
      acceleration: /** @type {const} */ ([acceleration_share, 1, time.length - 2]),
      angle: /** @type {const} */ ([q, 0, time.length]),
    }[kind];
    if (begin > 0) out.forEach((column, j) => column.push(j === 0 ? begin : null));
    for (let k = 0; k < count; k++) {
      const [low, high] = [time[Math.floor(k + offset)], time[Math.ceil(k + offset)]];
      out[0].push(begin + (low + high) / 2);
      for (let j = 0; j < joints; j++) {
        const value = rows[k * joints + j];
        out[j + 1].push(kind === "angle" ? axes[j].of(value) : 100 * value);
      }
    }
    begin += time[time.length - 1];
  }
  return out;
}

/**
 * Draw the curves of another plan behind those of a plot, dashed, in the colours of the joints.
 * @param {import("uplot")} plot
 * @param {(number | null)[][]} found
 * @param {Axis[]} axes
 * @param {Kind} kind
 * @param {(joint: number) => boolean} shown
 */
export function dashed(plot, [time, ...joints], axes, kind, shown) {
  if (!time) return;
  const { ctx: context, bbox } = plot;
  const ratio = window.devicePixelRatio || 1;
  context.save();
  context.beginPath();
  context.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  context.clip();
  context.lineWidth = 1.4 * ratio;
  context.globalAlpha = 0.75;
  context.setLineDash([4 * ratio, 3.5 * ratio]);
  joints.forEach((column, j) => {
    if (!shown(j)) return;
    context.strokeStyle = themeColour(axes[j].colour);
    context.beginPath();
    let drawing = false;
    column.forEach((value, k) => {
      if (value === null) return void (drawing = false);
      const [x, y] = [
        plot.valToPos(/** @type {number} */ (time[k]), "x", true),
        plot.valToPos(value, scaleOf(axes[j], kind), true),
      ];
      if (drawing) context.lineTo(x, y);
      else context.moveTo(x, y);
      drawing = true;
    });
    context.stroke();
  });
  context.restore();
}
