/** Pins on the map: drawn as bands, edited with the pointer, and listed beside the map. */

import { themeColour } from "../dom.js";
import { deg } from "../format.js";
import { html } from "../ui.js";
import { AROUND, intervals, pinOver, said, stretched, widened, Pins } from "./pins.js";

/** @typedef {import("./pins.js").Pin} Pin */
/** @typedef {import("./chart.js").Chart} Chart */
/** @typedef {{index: number, sides: Set<"start" | "end" | "low" | "high">}} Hit */
/** @typedef {{x: number, y: number, s: number, gamma: number}} Place px, m, deg */

const [NEAR, STILL] = [6, 5]; // px: a handle is hit, the pointer has not moved
const HATCH = 7; // px between lines

export class Bands {
  /**
   * @param {Chart} chart
   * @param {Pins} pins
   * @param {() => void} changed  called when the map has to be drawn again
   */
  constructor(chart, pins, changed) {
    this.chart = chart;
    this.pins = pins;
    this.changed = changed;
    /** @type {{from: Place, hit: Hit | null, pins: Pin[], moved: boolean} | null} */
    this.drag = null;
    this.took = false; // the click that ends a gesture is part of it
    const { canvas } = chart;
    canvas.addEventListener("pointerdown", (event) => this.begin(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.end(event));
    canvas.addEventListener("pointercancel", () => this.cancel());
  }

  /** Whether a band is being drawn or changed. */
  get busy() {
    return this.drag?.moved ?? false;
  }

  /** @type {(event: {offsetX: number, offsetY: number}) => Place} */
  place({ offsetX: x, offsetY: y }) {
    return { x, y, s: this.chart.sAt(x), gamma: this.chart.gammaAt(y) };
  }

  /**
   * Return the boxes of a pin, px.
   * @param {Pin} pin
   */
  boxes(pin) {
    const { grid, window, frame } = this.chart;
    const first = grid?.message.s[0] ?? 0;
    const [from, to] = [pin.start, pin.end].map((mm) => this.chart.x(first + mm / 1e3));
    // As wide as the cells of its nodes, and at least wide enough to be seen.
    const shown = (window.to - window.from) * Math.max(1, (grid?.nodes ?? 2) - 1);
    const beside = Math.max(2, frame.width / shown / 2);
    const [begin, end] = [this.chart.x(first), this.chart.x(first + (grid?.length ?? 0))];
    const x = Math.max(begin, from - beside);
    const width = Math.min(end, to + beside) - x;
    const y = (/** @type {number} */ angle) => this.chart.up(angle);
    return intervals(pin).map(([low, high]) => ({
      ...{ x, y: y(high), width, height: Math.max(2, y(low) - y(high)) },
      ...{ low, high },
    }));
  }

  /**
   * Return the pin at a place and its sides that are near; the chosen pin has priority.
   * @param {Place} place
   * @returns {Hit | null}
   */
  hit({ x, y }) {
    const { list, chosen } = this.pins;
    const order = list.map((_, i) => i).sort((a, b) => Number(b === chosen) - Number(a === chosen));
    for (const index of order)
      for (const box of this.boxes(list[index])) {
        const [right, bottom] = [box.x + box.width, box.y + box.height];
        if (x < box.x - NEAR || x > right + NEAR || y < box.y - NEAR || y > bottom + NEAR) continue;
        /** @type {Hit["sides"]} */
        const sides = new Set();
        if (box.width > 3 * NEAR) {
          if (Math.abs(x - box.x) <= NEAR) sides.add("start");
          else if (Math.abs(x - right) <= NEAR) sides.add("end");
        }
        // The edge of the map is not a side of the pin.
        if (Math.abs(y - box.y) <= NEAR && box.high < 180) sides.add("high");
        else if (Math.abs(y - bottom) <= NEAR && box.low > -180) sides.add("low");
        return { index, sides };
      }
    return null;
  }

  /** @param {PointerEvent} event */
  begin(event) {
    this.took = false;
    const { grid, canvas } = this.chart;
    if (event.button !== 0 || event.shiftKey || !grid?.layers.length || !this.pins.writable) return;
    const { frame } = this.chart;
    const [x, y] = [event.offsetX - frame.left, event.offsetY - frame.top];
    if (x < -NEAR || y < -NEAR || x > frame.width + NEAR || y > frame.height + NEAR) return;
    const from = this.place(event);
    this.drag = { from, hit: this.hit(from), pins: this.pins.list, moved: false };
    canvas.setPointerCapture(event.pointerId);
  }

  /** @param {PointerEvent} event */
  move(event) {
    const { drag, pins } = this;
    const { canvas } = this.chart;
    const to = this.place(event);
    if (!drag) {
      const sides = (this.chart.grid && this.hit(to)?.sides) || new Set();
      const across = sides.has("start") || sides.has("end");
      const up = sides.has("low") || sides.has("high");
      canvas.style.cursor = across ? (up ? "move" : "ew-resize") : up ? "ns-resize" : "";
      return;
    }
    if (!drag.moved && Math.hypot(to.x - drag.from.x, to.y - drag.from.y) < STILL) return;
    drag.moved = true;
    const made = drag.hit ? this.altered(drag.hit, to) : this.drawn(to);
    pins.preview = drag.hit
      ? drag.pins.map((pin, i) => (i === drag.hit?.index ? made : pin))
      : [...drag.pins, made];
    pins.chosen = drag.hit?.index ?? drag.pins.length;
    this.changed();
  }

  /**
   * Return the drawn pin: a rectangle, a place, or a stretch about one rotation.
   * @param {Place} to
   */
  drawn(to) {
    const { from } = /** @type {NonNullable<Bands["drag"]>} */ (this.drag);
    const grid = /** @type {import("./grid.js").Grid} */ (this.chart.grid);
    const end = Math.abs(to.x - from.x) < STILL ? from.s : to.s;
    let [low, high] = [Math.min(from.gamma, to.gamma), Math.max(from.gamma, to.gamma)];
    if (Math.abs(to.y - from.y) < STILL) [low, high] = [from.gamma - AROUND, from.gamma + AROUND];
    if (high - low > 359) high = low + 359;
    return pinOver(grid, from.s, end, low, high);
  }

  /**
   * Return the dragged pin with its dragged sides, or all of it, at the new place.
   * @param {Hit} hit
   * @param {Place} to
   */
  altered({ index, sides }, to) {
    const drag = /** @type {NonNullable<Bands["drag"]>} */ (this.drag);
    const grid = /** @type {import("./grid.js").Grid} */ (this.chart.grid);
    const [pin, first] = [drag.pins[index], grid.message.s[0]];
    let [from, till] = [first + pin.start / 1e3, first + pin.end / 1e3];
    let made = { ...pin };
    if (!sides.size) {
      const by = Math.min(Math.max(to.s - drag.from.s, first - from), first + grid.length - till);
      const up = to.gamma - drag.from.gamma;
      return pinOver(grid, from + by, till + by, pin.low + up, pin.high + up);
    }
    if (sides.has("low")) made = stretched(made, "low", to.gamma);
    if (sides.has("high")) made = stretched(made, "high", to.gamma);
    const by = to.s - drag.from.s;
    if (sides.has("start")) from = Math.min(from + by, till);
    if (sides.has("end")) till = Math.max(till + by, from);
    if (!sides.has("start") && !sides.has("end")) return made;
    return pinOver(grid, from, till, made.low, made.high);
  }

  /** @param {PointerEvent} event */
  end(event) {
    const { drag, pins } = this;
    if (!drag) return;
    this.drag = null;
    this.took = drag.moved || drag.hit !== null;
    const { preview } = pins;
    if (drag.moved && preview) pins.write(preview);
    else pins.chosen = drag.hit?.index ?? null;
    this.chart.canvas.releasePointerCapture(event.pointerId);
    this.changed();
  }

  cancel() {
    this.took = this.drag?.moved ?? false;
    this.drag = null;
    this.pins.preview = null;
    this.changed();
  }

  /**
   * Take a key of the map; return whether the pins used it.
   * @param {KeyboardEvent} event
   * @param {number} node  of the map's cursor
   * @param {number | null} course  deg, of the plan there or of the cursor
   */
  key(event, node, course) {
    const { pins } = this;
    const grid = /** @type {import("./grid.js").Grid} */ (this.chart.grid);
    const { chosen } = pins;
    if (event.key === "Escape" && (this.drag || chosen !== null)) {
      if (this.drag) this.cancel();
      else pins.chosen = null;
    } else if (event.key.toLowerCase() === "p" && course !== null && pins.writable) {
      const s = grid.message.s[node];
      pins.add(pinOver(grid, s, s, course - AROUND, course + AROUND));
    } else if (chosen === null || !pins.list[chosen]) return false;
    else if (event.key === "Delete" || event.key === "Backspace") pins.remove(chosen);
    else if (event.key === "+" || event.key === "-")
      pins.change(chosen, widened(pins.list[chosen], event.key === "+" ? 1 : -1));
    else return false;
    this.changed();
    return true;
  }

  /**
   * Draw every pin: its inside outlined, its outside hatched.
   * @param {CanvasRenderingContext2D} context
   */
  draw(context) {
    const { list, chosen } = this.pins;
    const scale = this.chart.frame.em / 13;
    list.forEach((pin, i) => {
      const boxes = this.boxes(pin);
      this.hatch(context, boxes, scale);
      context.strokeStyle = themeColour("--accent");
      context.lineWidth = (i === chosen ? 2.6 : 1.6) * scale;
      for (const { x, y, width, height } of boxes) context.strokeRect(x, y, width, height);
      if (i !== chosen) return;
      context.fillStyle = themeColour("--accent");
      const size = 7 * scale;
      const handle = (/** @type {number} */ at, /** @type {number} */ up) =>
        context.fillRect(at - size / 2, up - size / 2, size, size);
      for (const { x, y, width, height } of boxes)
        for (const end of [0, 1]) {
          handle(x + width / 2, y + end * height);
          if (width > 3 * NEAR) handle(x + end * width, y + height / 2);
        }
    });
  }

  /**
   * Dim and hatch the outside of the boxes of a pin, over its stretch.
   * @param {CanvasRenderingContext2D} context
   * @param {{x: number, y: number, width: number, height: number}[]} boxes
   * @param {number} scale
   */
  hatch(context, boxes, scale) {
    const { frame } = this.chart;
    const [{ x, width }] = boxes;
    context.save();
    context.beginPath();
    context.rect(x, frame.top, width, frame.height);
    for (const box of boxes) context.rect(box.x, box.y, box.width, box.height);
    context.clip("evenodd");
    context.globalAlpha = 0.5;
    context.fillStyle = themeColour("--panel");
    context.fillRect(x, frame.top, width, frame.height);
    context.globalAlpha = 0.75;
    context.strokeStyle = themeColour("--faint");
    context.lineWidth = scale;
    context.beginPath();
    const [tall, step] = [frame.height, HATCH * scale];
    // Lines continue over the whole map, so that those of two pins meet.
    const first = Math.floor((x - tall - frame.left) / step) * step + frame.left;
    for (let at = first; at < x + width; at += step) {
      context.moveTo(at, frame.top + tall);
      context.lineTo(at + tall, frame.top);
    }
    context.stroke();
    context.restore();
  }

  /** The list of pins for the side of the map. */
  listed() {
    const { pins } = this;
    if (!pins.writable) return null;
    const choose = (/** @type {number} */ i) => {
      pins.chosen = pins.chosen === i ? null : i;
      this.changed();
    };
    const remove = (/** @type {number} */ i) => {
      pins.remove(i);
      this.changed();
    };
    const rows = pins.list.map(
      (pin, i) => html`
        <li>
          <button aria-pressed=${String(pins.chosen === i)} onClick=${() => choose(i)}>
            ${said(pin)}
          </button>
          <button class="plain" title="Remove this pin" aria-label=${`Remove the pin ${said(pin)}`}
            onClick=${() => remove(i)}>×</button>
        </li>`,
    );
    return html`
      <section class="pins" aria-label="Pins of gamma">
        <h3>Pins</h3>
        <ul>${rows}</ul>
        <p class="quiet" hidden=${rows.length > 0}>
          Drag over the map to keep gamma inside a rectangle.
        </p>
      </section>`;
  }
}

/**
 * Return the rotation of the plan at a path length, deg, or null if no plan covers it.
 * @param {import("../messages.js").PlanMessage[]} plans
 * @param {number} s  m
 */
export function courseAt(plans, s) {
  for (const plan of plans) {
    const k = plan.s.findIndex((each) => Math.abs(each - s) < 1e-7);
    if (k >= 0) return deg(plan.gamma[k]);
  }
  return null;
}
