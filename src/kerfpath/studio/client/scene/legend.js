/** The legend of the colours of the contours. */

import { fixed } from "../format.js";
import { colourKey, html } from "../ui.js";
import { FAR } from "./paths.js";
import { SCALE_GRADIENT } from "./scale.js";

/**
 * The keys of the colours in use.
 * @param {import("./paths.js").Paths} paths
 * @param {string} why  there are no distances, where there are none
 */
export function legend({ by, range, tracks, enlarged }, why) {
  /** @type {(colour: string, words: string) => unknown} */
  const key = (colour, words) => html`<span class="chip">${colourKey(colour)}${words}</span>`;
  const kinds = tracks.flatMap(({ plan, kind }) => (plan ? kind : []));
  const leads = kinds.some((kind) => kind.startsWith("lead"));
  const others = kinds.some((kind) => kind !== "cut" && !kind.startsWith("lead"));
  const off = enlarged > 0 && key("--executed", executed(tracks));
  if (by === "kind")
    return html`
      ${key("--cut", "cut")}${others && key("--other", "other")}
      ${leads && key("--lead", "lead")}${key("--kerf", "cut so far")}${off}`;
  if (by === "clearance" && !tracks.some(({ clearance }) => clearance))
    return html`<span class="chip">${why}</span>${off}`;
  if (!Number.isFinite(range[0])) return null;
  const [low, high] = {
    load: ["0", "100 % of limit"],
    clearance: ["0", `${fixed(FAR * 1e3, 0)} mm and more`],
    speed: [fixed(range[0] * 60, 1), `${fixed(range[1] * 60, 1)} m/min`],
  }[by];
  const ramp = html`<i class="ramp" style=${{ background: SCALE_GRADIENT }} />`;
  return html`<span class="chip">${low}${ramp}${high}</span>${off}`;
}

/**
 * How far the executed paths that are known are from the drawing.
 * @param {import("./paths.js").Track[]} tracks
 */
function executed(tracks) {
  const known = tracks.flatMap(({ plan }) => plan?.executed ?? []);
  if (!known.length) return "executed: not known yet, or the robot stops at every node";
  const [largest, { joints }] = [Math.max(...known.map((each) => each.largest)), known[0]];
  return `executed, at most ${fixed(largest * 1e3, 2)} mm off; ${joints}`;
}
