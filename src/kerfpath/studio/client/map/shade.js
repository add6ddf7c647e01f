/** A quantity that shades the admitted poses of a map. */

import { digits, fixed, shownUnit } from "../format.js";
import { bytes } from "./grid.js";
import { MOST, NO_SHADE, TOO_NEAR } from "./paint.js";

/** @typedef {import("../messages.js").ShadeMessage} ShadeMessage */

let made = 0;

export class Shade {
  /** @param {ShadeMessage} message */
  constructor(message) {
    this.message = message;
    this.number = ++made;
    /** @type {Map<number, {values: Uint8Array, nearest: Uint8Array | null}>} by posture */
    this.layers = new Map(
      message.layers.map(({ posture, values, nearest }) => [
        posture,
        { values: bytes(values), nearest: nearest === null ? null : bytes(nearest) },
      ]),
    );
  }

  /**
   * Return the codes of a posture, all gamma of a node in a row.
   * @param {number} posture
   */
  of(posture) {
    return this.layers.get(posture)?.values;
  }

  /**
   * Return the value at a place of the map in words; "" without a value.
   * @param {number} posture
   * @param {number} place  of all gamma of all nodes
   */
  said(posture, place) {
    const layer = this.layers.get(posture);
    const code = layer?.values[place] ?? NO_SHADE;
    if (!layer || code === NO_SHADE) return "";
    const names = this.message.pairs[layer.nearest?.[place] ?? NO_SHADE] ?? [];
    const pair = names.length ? `, ${names.join(" \u2013 ")}` : "";
    if (code === TOO_NEAR) return names.join(" \u2013 ");
    const { low, high, words, beyond, unit } = this.message;
    if (!unit) return `${words}: ${fixed(low + ((high - low) * code) / MOST, 0)}`;
    const value = this.shown(low + ((high - low) * code) / MOST);
    // Values that are only known up to a distance are lower bounds.
    const from = beyond ? "at least " : "";
    return `${words}: ${from}${value}${code < MOST ? pair : ""}`;
  }

  /** @param {number} value */
  shown(value) {
    const { unit, of } = shownUnit(this.message.unit);
    return `${digits(of(value), 2)} ${unit}`.trim();
  }

  /**
   * Whether a body is too close at a place.
   * @param {number} posture
   * @param {number} place
   */
  tooNear(posture, place) {
    return this.of(posture)?.[place] === TOO_NEAR;
  }

  /** Whether a body is too close anywhere. */
  get closed() {
    return [...this.layers.values()].some(({ values }) => values.includes(TOO_NEAR));
  }
}
