/** The legend of a map: its colours and patterns, with the share of each. */

import { useLayoutEffect, useRef } from "preact/hooks";

import { percent } from "../format.js";
import { SCALE_GRADIENT } from "../scene/scale.js";
import { folded, html } from "../ui.js";
import { swatch } from "./paint.js";

const SWATCH = 28; // px, drawn at half that size

/**
 * The legend of a layer: free places first, then reasons by decreasing share.
 * @param {import("./grid.js").Grid} grid
 * @param {number} layer
 * @param {import("./paint.js").Ink[]} inks
 * @param {{course: boolean, before: string | null, shaded: boolean}} lines
 *   before: name of the dashed course; shaded: free places have the colours of a scale
 */
export function legend(grid, layer, inks, { course, before, shaded }) {
  const { reasons, external, hidden } = grid.message;
  const total = grid.nodes * grid.samples;
  const order = grid.counts(layer).map((count, code) => ({ count, code }));
  order.sort((a, b) => Number(b.code === 0) - Number(a.code === 0) || b.count - a.count);
  const rows = order.map(({ count, code }) => {
    const share = count / total;
    const mark =
      shaded && inks[code].free
        ? html`<i class="swatch" style=${{ background: SCALE_GRADIENT }} />`
        : html`<${Swatch} ink=${inks[code]} />`;
    return (
      count > 0 &&
      html`
        <li>
          ${mark}<span>${code === 0 ? "free" : reasons[code]}</span>
          <b>${share < 0.005 ? "< 1 %" : percent(share)}</b>
        </li>`
    );
  });
  const line = (/** @type {string} */ kind, /** @type {string} */ words) =>
    html`<li><i class=${`line ${kind}`} /><span>${words}</span></li>`;
  const lines = html`
    <ul class="lines">
      ${course && line("course", "course")}${before && line("before", `course ${before}`)}
    </ul>`;
  return html`
    <ul>${rows}</ul>
    ${external && html`<p class="quiet">${external}</p>`}
    ${(course || before) && lines}
    ${folded("Postures not shown", hidden)}`;
}

/** @param {{ink: import("./paint.js").Ink}} props */
function Swatch({ ink }) {
  const canvas = useRef(/** @type {HTMLCanvasElement | null} */ (null));
  useLayoutEffect(() => {
    canvas.current?.getContext("2d")?.putImageData(swatch(ink, SWATCH, 12), 0, 0);
  });
  return html`<canvas ref=${canvas} class="swatch" width=${SWATCH} height=${SWATCH} />`;
}
