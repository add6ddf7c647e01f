/** A colour scale that colour-blind people can read: viridis, from five of its colours. */

import { Color } from "three";

const COLOURS = ["#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"];
const STOPS = COLOURS.map((each) => new Color(each));

/**
 * Return the colour of a share of the scale; beyond 1 the colour of excess.
 * @param {number} share
 * @returns {Color}
 */
export function alongScale(share) {
  if (share > 1 + 1e-6) return new Color("#d7263d");
  const at = Math.min(Math.max(share, 0), 1) * (STOPS.length - 1);
  const low = Math.min(Math.floor(at), STOPS.length - 2);
  return STOPS[low].clone().lerp(STOPS[low + 1], at - low);
}

/** The same scale for style sheets. */
export const SCALE_GRADIENT = `linear-gradient(to right, ${COLOURS.join(", ")})`;
