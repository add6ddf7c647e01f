/** The joints of the chosen contour over time: speed, acceleration, position, and a cursor. */

import UPlot from "uplot";

import { axesOf } from "./axes.js";
import { columns, dashed, scaleOf } from "./curves.js";
import { player, store } from "./app.js";
import { byId, onNextFrame, textSize, themeColour } from "./dom.js";
import { digits, extent, fixed, secondsOf } from "./format.js";
import { colourKey, draw, html, mount, segments } from "./ui.js";

/** @typedef {import("./curves.js").Kind} Kind */

/** @type {Record<Kind, {title: string, per: string, labels: Record<string, string>}>} labels of scales */
const KINDS = {
  speed: { title: "Speed", per: "/s", labels: { "%": "joint speed, % of limit" } },
  acceleration: {
    title: "Accel.",
    per: "/s\u00b2",
    labels: { "%": "joint acceleration, % of limit" },
  },
  angle: { title: "Angle", per: "", labels: { deg: "joint angle, deg", mm: "linear axes, mm" } },
};

export class Plots {
  constructor() {
    this.host = byId("plot");
    this.line = document.createElement("div");
    this.tip = document.createElement("div");
    Object.assign(this.line, { className: "plot-line", hidden: true });
    Object.assign(this.tip, { className: "tip plot-tip", hidden: true });
    /** @type {Kind} */
    this.kind = "speed";
    /** @type {Set<number>} joints that are not shown */
    this.off = new Set();
    /** @type {UPlot | null} */
    this.plot = null;
    /** @type {(number | null)[][]} the curves of the plan to compare with */
    this.beside = [];
    /** Draw the plot with the next frame. */
    this.invalidate = onNextFrame(() => this.draw());
    mount(byId("plot-kind"), () => this.tabs());
    mount(byId("plot-legend"), () => this.legend());
    mount(byId("plot-state"), () => this.state());
    store.on(["selected", "plan", "scene", "job", "compare"], this.invalidate);
    player.on(() => this.follow());
    new ResizeObserver(() => this.resize()).observe(this.host);
  }

  /** Buttons for what is plotted. */
  tabs() {
    const kinds = Object.entries(KINDS).map(([value, { title }]) => ({ value, label: title }));
    return segments("Plotted quantity", kinds, this.kind, (kind) => {
      this.kind = /** @type {Kind} */ (kind);
      this.invalidate();
    });
  }

  /** A text if there is nothing to plot. */
  state() {
    const why = this.why();
    return why && html`<p>${why}</p>`;
  }

  /** Why nothing is plotted, or "". */
  why() {
    const { plans, axes } = this.shown();
    if (store.nopaths.has(store.selected ?? "") && !plans.length)
      return "No motion to plot: this contour has no path.";
    if (!plans.length)
      return store.progress.busy
        ? "Speeds and accelerations appear with the plan."
        : "No motion to plot: this contour is not planned.";
    if (axes.every((_, j) => this.off.has(j))) return "All joints are hidden; show one above.";
    const most = Math.max(...plans.map(({ time }) => time.length));
    if (this.kind === "acceleration" && most < 3)
      return `No acceleration to plot: it takes 3 nodes, and this cut has ${most}.`;
    return "";
  }

  /** The shown plans, the joints of the robot, and their axes. */
  shown() {
    const { robot } = store.scene ?? {};
    return { plans: store.chosen, axes: axesOf(robot), joints: robot?.joints ?? [] };
  }

  draw() {
    const { plans, axes } = this.shown();
    this.plot?.destroy();
    this.plot = null;
    this.host.replaceChildren();
    this.host.dataset.contour = store.selected ?? "";
    if (!plans.length || !this.host.clientHeight) return;
    const against = store.compared(store.selected ?? "");
    this.beside = against.length ? columns(against, axes, this.kind) : [];
    const scales = [...new Set(axes.map((each) => scaleOf(each, this.kind)))];
    const em = textSize();
    const font = `${0.82 * em}px ${getComputedStyle(document.body).fontFamily}`;
    const [quiet, line, rule] = ["--quiet", "--line", "--rule"].map(themeColour);
    const axis = { stroke: quiet, font, labelFont: font, labelGap: 0, labelSize: 1.3 * em };
    const grid = { stroke: line, width: 1 };
    const ticks = { stroke: rule, width: 1, size: 4 };
    this.plot = new UPlot(
      {
        width: this.host.clientWidth,
        height: this.host.clientHeight,
        legend: { show: false },
        padding: [0.4 * em, 0.8 * em, 0, 0],
        scales: {
          x: { time: false, range: (_, low, high) => this.until(low, high) },
          ...Object.fromEntries(
            scales.map((scale) => [
              scale,
              {
                /** @type {import("uplot").Range.Function} */
                range: (_, low, high) => this.range(low ?? 0, high ?? 0, scale),
              },
            ]),
          ),
        },
        cursor: { y: false, points: { size: 0.45 * em }, drag: { x: false, y: false } },
        axes: [
          {
            ...axis,
            grid: { show: false },
            ticks,
            label: "time in the cut, s",
            size: 1.6 * em,
            gap: 3,
            space: 4 * em,
          },
          ...scales.map((scale, i) => ({
            ...axis,
            scale,
            side: /** @type {const} */ ([3, 1])[i],
            grid: i ? { show: false } : grid,
            ticks,
            label: KINDS[this.kind].labels[scale],
            size: 2.9 * em,
            gap: 3,
            space: 2 * em,
          })),
        ],
        series: [
          {},
          ...axes.map((each, j) => ({
            scale: scaleOf(each, this.kind),
            stroke: themeColour(each.colour),
            width: Math.max(1.5, em / 9),
            points: { show: false },
            show: !this.off.has(j),
          })),
        ],
        hooks: {
          drawAxes: [
            (plot) => dashed(plot, this.beside, axes, this.kind, (joint) => !this.off.has(joint)),
          ],
          draw: [(plot) => this.limits(plot)],
          setCursor: [(plot) => this.say(plot)],
        },
      },
      /** @type {any} */ (columns(plans, axes, this.kind)),
      this.host,
    );
    this.plot.over.append(this.line);
    this.host.append(this.tip);
    this.plot.over.addEventListener("click", (event) => {
      if (this.plot) this.go(this.plot.posToVal(event.offsetX, "x"));
    });
    this.follow();
  }

  /**
   * @param {number} first
   * @param {number} last
   * @returns {[number, number]} with the whole of what is compared
   */
  until(first, last) {
    const times = this.beside[0] ?? [];
    return [first, Math.max(last, times[times.length - 1] ?? last)];
  }

  /** @type {(least: number, most: number, scale: string) => [number, number]} */
  range(least, most, scale) {
    const { axes } = this.shown();
    const here = (/** @type {number} */ j) =>
      !this.off.has(j) && axes[j] && scaleOf(axes[j], this.kind) === scale;
    const beside = this.beside.slice(1).filter((_, j) => here(j));
    const [other, others] = extent(beside.flat());
    const [low, high] = [Math.min(least, other), Math.max(most, others)];
    if (this.kind === "angle") {
      const room = Math.max(2, 0.06 * (high - low));
      return [low - room, high + room];
    }
    const reach = Math.max(Math.abs(low), Math.abs(high), 20) * 1.12;
    return [-reach, reach];
  }

  /**
   * Draw the limits of the job and of the robot's maker.
   * @param {UPlot} plot
   */
  limits(plot) {
    if (this.kind === "angle") return;
    const options = store.job?.values?.plan;
    const eta = (this.kind === "speed" ? options?.eta_velocity : options?.eta_acceleration) ?? 1;
    const { ctx: context, bbox } = plot;
    context.save();
    context.beginPath();
    context.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    context.clip();
    const ratio = window.devicePixelRatio || 1;
    for (const [share, colour, dash] of /** @type {[number, string, number[]][]} */ ([
      [1, "--alert", []],
      [eta, "--caution-line", [5, 4]],
    ]))
      for (const sign of [-1, 1]) {
        const y = plot.valToPos(sign * share * 100, "%", true);
        context.strokeStyle = themeColour(colour);
        context.lineWidth = 1.2 * ratio;
        context.setLineDash(dash.map((each) => each * ratio));
        context.beginPath();
        context.moveTo(bbox.left, y);
        context.lineTo(bbox.left + bbox.width, y);
        context.stroke();
      }
    context.restore();
  }

  /** Buttons that show and hide the joints. */
  legend() {
    const { plans, axes, joints } = this.shown();
    if (!plans.length) return null;
    return axes.map(({ label, unit, of, colour }, j) => {
      const { name, lower, upper, velocity, acceleration } = joints[j];
      const [low, high] = [lower, upper].map((each) => each !== null && digits(of(each), 4));
      const travel = low === false ? "endless" : `${low} to ${high} ${unit}`;
      const [speed, acc] = [velocity, acceleration].map((each) => digits(of(each), 4));
      const title = `Show or hide ${name}: ${travel}, ${speed} ${unit}/s, ${acc} ${unit}/s\u00b2`;
      const toggle = () => {
        if (!this.off.delete(j)) this.off.add(j);
        this.plot?.setSeries(j + 1, { show: !this.off.has(j) });
      };
      return html`
        <button class="joint" aria-pressed=${String(!this.off.has(j))} title=${title}
          onClick=${toggle}>${colourKey(colour)}${label}</button>`;
    });
  }

  /**
   * Show the values under the pointer.
   * @param {UPlot} plot
   */
  say(plot) {
    const { idx, left = -1 } = plot.cursor;
    this.tip.hidden = idx === null || idx === undefined || left < 0;
    if (this.tip.hidden || idx === null || idx === undefined) return;
    const { axes, joints } = this.shown();
    const rows = plot.data.slice(1).flatMap((column, j) => {
      const value = column[idx];
      if (this.off.has(j) || value === null || value === undefined) return [];
      const { label, unit, of, colour } = axes[j];
      const { velocity, acceleration } = joints[j];
      const limit = { speed: velocity, acceleration, angle: 0 }[this.kind];
      const so = `${digits((of(limit) * value) / 100)} ${unit}${KINDS[this.kind].per}`;
      const share = `${fixed(value, 1)} ${scaleOf(axes[j], this.kind)}`;
      const text = limit ? `${share}, ${so}` : share;
      return html`<span>${colourKey(colour)}${label} <b>${text}</b></span>`;
    });
    draw(this.tip, html`<span class="quiet">${fixed(plot.data[0][idx], 3)} s</span>${rows}`);
    const x = left + plot.over.offsetLeft;
    const right = x + 14 + this.tip.offsetWidth > this.host.clientWidth;
    this.tip.style.transform = `translate(${right ? x - 14 - this.tip.offsetWidth : x + 14}px, 6px)`;
  }

  /**
   * Go to a time of the cut.
   * @param {number} t  s from where its first piece begins
   */
  go(t) {
    let rest = t;
    const { plans } = this.shown();
    for (const plan of plans) {
      const length = plan.time[plan.time.length - 1];
      if (rest <= length || plan === plans[plans.length - 1]) {
        const begin = player.timeline.when(plan, 0);
        if (begin !== null) player.seek(begin + Math.min(Math.max(rest, 0), length));
        return;
      }
      rest -= length;
    }
  }

  /** Move the line to the time of the player. */
  follow() {
    const { moment } = player;
    const { plans } = this.shown();
    const index = plans.findIndex((plan) => plan.name === moment?.span.plan?.name);
    this.line.hidden = !this.plot || !moment || index < 0;
    if (this.line.hidden || !this.plot || !moment) return;
    const before = secondsOf(plans.slice(0, index));
    this.line.style.transform = `translateX(${this.plot.valToPos(before + moment.local, "x")}px)`;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (!this.plot && height) return this.invalidate();
    if (this.plot && height) this.plot.setSize({ width, height });
    this.follow();
  }
}
