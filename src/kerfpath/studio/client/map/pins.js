/** Pins: windows of gamma of the chosen contour, read from the job and written to it. */

import { send, store } from "../app.js";

/** @typedef {import("./grid.js").Grid} Grid */
/** @typedef {{start: number, end: number, low: number, high: number}} Pin mm and deg */

/** Half width of a pin without a drawn height, about the course, deg. */
export const AROUND = 10;
const [NARROWEST, WIDEST] = [0.2, 359];

/** @param {number} angle  deg */
const turned = (angle) => ((angle % 360) + 360) % 360;

/**
 * Return an angle in [-180, 180), rounded to a tenth of a degree.
 * @param {number} angle  deg
 */
const written = (angle) => Math.round((turned(angle + 180) - 180) * 10) / 10;

/**
 * Return how wide a pin is, deg.
 * @param {Pin} pin
 */
const widthOf = (pin) => turned(pin.high - pin.low);

/**
 * Return the intervals of a pin on a map from -180 to 180 deg: two if it crosses the edge.
 * @param {Pin} pin
 * @returns {[number, number][]}
 */
export function intervals(pin) {
  const low = turned(pin.low + 180) - 180;
  const high = low + widthOf(pin);
  if (high <= 180) return [[low, high]];
  return [
    [low, 180],
    [-180, high - 360],
  ];
}

/**
 * Return a pin in words, with units.
 * @param {Pin} pin
 */
export function said({ start, end, low, high }) {
  const at = start === end ? `${start} mm` : `${start} to ${end} mm`;
  return `${at}: ${low} to ${high} deg`;
}

/**
 * Return a pin over the nodes of a map next to two path lengths, its ends rounded outwards.
 * @param {Grid} grid
 * @param {number} from  m
 * @param {number} to  m
 * @param {number} low  deg
 * @param {number} high  deg
 * @returns {Pin}
 */
export function pinOver(grid, from, to, low, high) {
  const [first, s] = [grid.message.s[0], grid.message.s];
  const place = (/** @type {number} */ at) => (s[grid.nodeAt(at)] - first) * 1e3;
  const [start, end] = [place(Math.min(from, to)), place(Math.max(from, to))];
  return {
    // Rounding must not lose the node: 1e-6 of a tenth is far below the distance of two nodes.
    ...{ start: Math.floor(start * 10 + 1e-6) / 10, end: Math.ceil(end * 10 - 1e-6) / 10 },
    ...{ low: written(low), high: written(high) },
  };
}

/**
 * Return a pin with one end of gamma moved; the unchanged pin if it would turn inside out.
 * @param {Pin} pin
 * @param {"low" | "high"} side
 * @param {number} angle  deg
 * @returns {Pin}
 */
export function stretched(pin, side, angle) {
  const made = { ...pin, [side]: written(angle) };
  const [before, after] = [widthOf(pin), widthOf(made)];
  const fits = after >= NARROWEST && after <= WIDEST && Math.abs(after - before) < 180;
  return fits ? made : pin;
}

/**
 * Return a pin that is wider by `by` degrees on either side.
 * @param {Pin} pin
 * @param {number} by  deg
 * @returns {Pin}
 */
export function widened(pin, by) {
  const width = widthOf(pin) + 2 * by;
  if (width < NARROWEST || width > WIDEST) return pin;
  return { ...pin, low: written(pin.low - by), high: written(pin.high + by) };
}

/** The pins of the chosen contour. */
export class Pins {
  constructor() {
    /** @type {number | null} */
    this.chosen = null;
    /** @type {Pin[] | null} pins that are being drawn, until the job has them */
    this.preview = null;
    store.on(["job", "selected"], () => {
      this.preview = null;
      if (this.chosen !== null && this.chosen >= this.list.length) this.chosen = null;
    });
    store.on(["selected"], () => (this.chosen = null));
  }

  /** @returns {Pin[]} */
  get list() {
    if (this.preview) return this.preview;
    /** @type {number[][]} */
    const kept = store.job?.values?.contour?.[store.table ?? -1]?.gamma_windows ?? [];
    return kept.map(([start, end, low, high]) => ({ start, end, low, high }));
  }

  /** Whether there is a job to write them to. */
  get writable() {
    return store.table !== null && Boolean(store.job?.values);
  }

  /**
   * Write pins to the job, as one step of undo.
   * @param {Pin[]} pins
   */
  write(pins) {
    const { table } = store;
    if (table === null) return;
    const value = pins.map(({ start, end, low, high }) => [start, end, low, high]);
    this.preview = pins;
    send({
      type: "edit",
      path: ["contour", table, "gamma_windows"],
      value: value.length ? value : null,
    });
  }

  /** @param {Pin} pin */
  add(pin) {
    const { list } = this;
    this.write([...list, pin]);
    this.chosen = list.length;
  }

  /** @type {(index: number, pin: Pin) => void} */
  change(index, pin) {
    this.write(this.list.map((each, i) => (i === index ? pin : each)));
  }

  /** @param {number} index */
  remove(index) {
    this.chosen = null;
    this.write(this.list.filter((_, i) => i !== index));
  }
}
