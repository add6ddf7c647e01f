/** The legend of a map: its colours and patterns, with the share of each. */

import { el } from "../dom.js";
import { percent } from "../format.js";
import { SCALE_GRADIENT } from "../scene/scale.js";
import { Grid } from "./grid.js";
import { pixels } from "./paint.js";

const SWATCH = 28; // px, drawn at half that size

/**
 * Return the legend of a layer: free places first, then reasons by decreasing share.
 * @param {Grid} grid
 * @param {number} layer
 * @param {import("./paint.js").Ink[]} ink
 * @param {{course: boolean, before: string | null, shaded: boolean}} lines
 *   before: name of the dashed course; shaded: free places have the colours of a scale
 * @returns {Node[]}
 */
export function legend(grid, layer, ink, lines) {
  const { message } = grid;
  const total = grid.nodes * grid.samples;
  const found = grid.counts(layer).map((count, code) => ({ count, code }));
  const order = found.filter(({ count }) => count > 0);
  order.sort((a, b) => Number(b.code === 0) - Number(a.code === 0) || b.count - a.count);
  const rows = order.map(({ count, code }) => {
    const share = count / total;
    return el(
      "li",
      {},
      lines.shaded && ink[code].free ? ramp() : swatch(message, ink[code]),
      el("span", {}, code === 0 ? "free" : message.reasons[code]),
      el("b", {}, share < 0.005 ? "< 1 %" : percent(share)),
    );
  });
  const line = (/** @type {string} */ kind, /** @type {string} */ words) =>
    el("li", {}, el("i", { class: `line ${kind}` }), el("span", {}, words));
  const keys = el(
    "ul",
    { class: "lines" },
    lines.course ? line("course", "course") : null,
    lines.before === null ? null : line("before", `course ${lines.before}`),
  );
  const hidden = message.hidden.map((each) => el("p", {}, each));
  return [
    el("ul", {}, ...rows),
    ...(message.external ? [el("p", { class: "quiet" }, message.external)] : []),
    ...(keys.childElementCount ? [keys] : []),
    ...(hidden.length
      ? [el("details", {}, el("summary", {}, "Postures not shown"), ...hidden)]
      : []),
  ];
}

function ramp() {
  const made = el("i", { class: "swatch" });
  made.style.background = SCALE_GRADIENT;
  return made;
}

/**
 * @param {import("../messages.js").MapMessage} message
 * @param {import("./paint.js").Ink} ink
 */
function swatch(message, ink) {
  const canvas = el("canvas", { class: "swatch", width: SWATCH, height: SWATCH });
  const one = new Grid({
    ...message,
    ...{ nodes: 1, s: [0], gamma: [0], layers: [{ posture: 0, name: "", codes: "AA==" }] },
  });
  canvas
    .getContext("2d")
    ?.putImageData(pixels(one, 0, [ink], { width: SWATCH, height: SWATCH, period: 12 }), 0, 0);
  return canvas;
}
