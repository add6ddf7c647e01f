/** A map message, unpacked: the codes of all poses, and the node and sample of a place. */

import { interval } from "../kinematics.js";

/** @typedef {import("../messages.js").MapMessage} MapMessage */

export class Grid {
  /** @param {MapMessage} message */
  constructor(message) {
    this.message = message;
    this.nodes = message.nodes;
    this.samples = message.gamma.length;
    this.layers = message.layers.map((layer) => ({ ...layer, codes: bytes(layer.codes) }));
    this.length = message.s[message.s.length - 1] - message.s[0] || 1;
  }

  /** @type {(layer: number, node: number, sample: number) => number} */
  code(layer, node, sample) {
    return this.layers[layer].codes[node * this.samples + sample];
  }

  /**
   * Return the node nearest to a path length.
   * @param {number} s  m
   */
  nodeAt(s) {
    const list = this.message.s;
    const low = interval(list, s);
    const high = Math.min(low + 1, list.length - 1);
    return s - list[low] <= list[high] - s ? low : high;
  }

  /**
   * Return the sample nearest to a rotation.
   * @param {number} gamma  rad
   */
  sampleAt(gamma) {
    const list = this.message.gamma;
    const angle = wrapped(gamma);
    // The ends of windows are also samples: steps are uneven.
    const low = list.findLastIndex((each) => each <= angle);
    const [below, above] = [low < 0 ? list.length - 1 : low, (low + 1) % list.length];
    const off = (/** @type {number} */ at) => Math.abs(wrapped(list[at] - angle));
    return off(above) < off(below) ? above : below;
  }

  /**
   * Return the number of poses of a layer with each code.
   * @param {number} layer
   */
  counts(layer) {
    const found = new Array(this.message.reasons.length).fill(0);
    for (const code of this.layers[layer].codes) found[code]++;
    return found;
  }

  /**
   * Return the layer of a posture, or -1.
   * @param {number} posture
   */
  layerOf(posture) {
    return this.layers.findIndex((layer) => layer.posture === posture);
  }
}

/**
 * @param {string} base64
 * @returns {Uint8Array}
 */
export function bytes(base64) {
  const text = atob(base64);
  const out = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) out[i] = text.charCodeAt(i);
  return out;
}

/**
 * Return a rotation in (-pi, pi].
 * @param {number} angle
 */
export const wrapped = (angle) => {
  const turned = angle - 2 * Math.PI * Math.floor((angle + Math.PI) / (2 * Math.PI));
  return turned === -Math.PI ? Math.PI : turned;
};
