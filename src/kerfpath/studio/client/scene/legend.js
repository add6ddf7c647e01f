/** The legend of the colours of the contours. */

import { el } from "../dom.js";
import { fixed } from "../format.js";
import { FAR } from "./paths.js";
import { SCALE_GRADIENT } from "./scale.js";

/**
 * Return the keys of the colours in use.
 * @param {import("./paths.js").Paths} paths
 * @param {string} why  there are no distances, where there are none
 */
export function legend(paths, why) {
  const { by, range } = paths;
  const key = (/** @type {string} */ colour, /** @type {string} */ text) => {
    const chip = el("i", { class: "key" });
    chip.style.background = `var(${colour})`;
    return el("span", { class: "chip" }, chip, text);
  };
  const kinds = new Set(paths.tracks.flatMap(({ plan, kind }) => (plan ? kind : [])));
  const shown = [];
  if (by === "kind") {
    shown.push(key("--kerf", "cut so far"));
    if ([...kinds].some((kind) => kind.startsWith("lead"))) shown.unshift(key("--lead", "lead"));
    if ([...kinds].some((kind) => kind !== "cut" && !kind.startsWith("lead")))
      shown.unshift(key("--other", "other"));
    shown.unshift(key("--cut", "cut"));
  } else {
    const strip = el("i", { class: "ramp" });
    strip.style.background = SCALE_GRADIENT;
    const [low, high] =
      by === "load" || by === "clearance"
        ? ["0", "100 % of limit"]
        : range.map((each) => fixed(each * 60, 1));
    const end =
      by === "load"
        ? high
        : by === "clearance"
          ? `${fixed(FAR * 1e3, 0)} mm and more`
          : `${high} m/min`;
    if (by === "clearance" && !paths.tracks.some(({ clearance }) => clearance))
      shown.unshift(el("span", { class: "chip" }, why));
    else if (Number.isFinite(range[0]))
      shown.unshift(el("span", { class: "chip" }, low, strip, end));
  }
  return shown;
}
