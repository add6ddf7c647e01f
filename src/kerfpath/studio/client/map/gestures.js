/** Zoom and pan of a map: wheel, a drag with Shift or the middle button, keys. */

import { ARROWS, byId } from "../dom.js";
import { isWhole, moved, showing, WHOLE, zoomed } from "./window.js";

/** @typedef {import("./chart.js").Chart} Chart */
/** @typedef {import("./window.js").Window} Window */

const NODES = 6; // least number in view
const DEGREES = 12; // least range in view
const STEP = 1.3; // of a key, and of a notch of the wheel
const NOTCH = 100; // px of the wheel

export class Gestures {
  /**
   * @param {Chart} chart
   * @param {() => void} changed
   */
  constructor(chart, changed) {
    this.chart = chart;
    this.changed = changed;
    /** @type {Map<string, Window>} by contour */
    this.kept = new Map();
    /** @type {{x: number, y: number, seen: Window} | null} */
    this.drag = null;
    this.reset = byId("map-whole", HTMLButtonElement);
    this.reset.addEventListener("click", () => {
      this.see(WHOLE);
      chart.canvas.focus();
    });
    const { canvas } = chart;
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("dblclick", () => this.see(WHOLE));
    canvas.addEventListener("pointerdown", (event) => this.begin(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", () => (this.drag = null));
    canvas.addEventListener("pointercancel", () => (this.drag = null));
  }

  /** Restore the view that the contour of the chart's map had before. */
  recall() {
    const { grid } = this.chart;
    this.chart.window = (grid && this.kept.get(grid.message.contour)) ?? WHOLE;
    this.reset.hidden = isWhole(this.chart.window);
  }

  /** @param {Window} window */
  see(window) {
    const { grid } = this.chart;
    if (!grid) return;
    this.kept.set(grid.message.contour, window);
    this.recall();
    this.changed();
  }

  /** Move the view so that it contains a place of the map.
   * @param {number} along  share of the map
   * @param {number} down  share of the map
   */
  show(along, down) {
    const { window } = this.chart;
    if (!isWhole(window)) this.see(showing(window, along, down));
  }

  /**
   * @param {number} x  share of what is seen
   * @param {number} y  share of what is seen
   * @param {number} factor
   */
  zoom(x, y, factor) {
    const least = { across: NODES / (this.chart.grid?.nodes ?? NODES), down: DEGREES / 360 };
    this.see(zoomed(this.chart.window, x, y, factor, least));
  }

  /**
   * @param {{offsetX: number, offsetY: number}} event
   */
  share({ offsetX, offsetY }) {
    const { left, top, width, height } = this.chart.frame;
    const within = (/** @type {number} */ at) => Math.min(1, Math.max(0, at));
    return { x: within((offsetX - left) / width), y: within((offsetY - top) / height) };
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    if (!this.chart.grid?.layers.length) return;
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 33 : 1;
    const [across, down] = [event.deltaX * lines, event.deltaY * lines];
    if (event.shiftKey || Math.abs(across) > Math.abs(down)) {
      const { width } = this.chart.frame;
      this.see(moved(this.chart.window, (across || down) / width, 0));
      return;
    }
    const { x, y } = this.share(event);
    const notches = Math.min(3, Math.max(-3, down / NOTCH));
    this.zoom(x, y, STEP ** notches);
  }

  /** @param {PointerEvent} event */
  begin(event) {
    if (event.button !== 1 && !(event.button === 0 && event.shiftKey)) return;
    event.preventDefault();
    this.drag = { x: event.offsetX, y: event.offsetY, seen: this.chart.window };
    this.chart.canvas.setPointerCapture(event.pointerId);
  }

  /** @param {PointerEvent} event */
  move(event) {
    if (!this.drag) return;
    const { width, height } = this.chart.frame;
    const { x, y, seen } = this.drag;
    this.see(moved(seen, (x - event.offsetX) / width, (y - event.offsetY) / height));
  }

  /**
   * Take a key: plus and minus zoom about a place, Ctrl and arrows move, Home shows all.
   * @param {KeyboardEvent} event
   * @param {{x: number, y: number}} at  shares of what is seen
   */
  key(event, at) {
    const move = ARROWS[event.key];
    const ctrl = event.ctrlKey || event.metaKey;
    if (ctrl && move) this.see(moved(this.chart.window, 0.2 * move[0], 0.2 * move[1]));
    else if (ctrl || event.altKey) return false;
    else if (event.key === "+" || event.key === "=") this.zoom(at.x, at.y, 1 / STEP);
    else if (event.key === "-") this.zoom(at.x, at.y, STEP);
    else if (event.key === "Home") this.see(WHOLE);
    else return false;
    return true;
  }
}
