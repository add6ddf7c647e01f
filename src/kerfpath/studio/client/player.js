/** The clock of the motion: play, pause, step, scrub; it calls listeners with the robot's pose. */

import { Timeline } from "./timeline.js";

/** @typedef {import("./timeline.js").Moment} Moment */

/** Plays a timeline. When the program changes, the time stays at the same place of the program. */
export class Player {
  constructor() {
    this.timeline = new Timeline([], 0, false);
    this.t = 0;
    this.playing = false;
    this.rate = 1;
    this.frame = 0;
    this.last = 0;
    /** @type {Set<(moment: Moment | null) => void>} */
    this.listeners = new Set();
  }

  /**
   * Call `listener` whenever time, program or play state change.
   * @param {(moment: Moment | null) => void} listener
   */
  on(listener) {
    this.listeners.add(listener);
  }

  /** The moment that is shown. */
  get moment() {
    return this.timeline.at(this.t);
  }

  emit() {
    const { moment } = this;
    for (const listener of this.listeners) listener(moment);
  }

  /**
   * Take a new program; the clock stays at the same share of the same contour's cut.
   * @param {Timeline} timeline
   */
  load(timeline) {
    const old = this.moment;
    this.timeline = timeline;
    this.t = Math.min(this.t, timeline.total);
    if (old?.span.contour) {
      const { contour, kind, begin, end } = old.span;
      const same = timeline.spans.find((each) => each.contour === contour && each.kind === kind);
      const share = end > begin ? old.local / (end - begin) : 0;
      if (same) this.t = same.begin + share * (same.end - same.begin);
    }
    if (!timeline.spans.length) this.pause();
    this.emit();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.playing || !this.timeline.spans.length) return;
    if (this.t >= this.timeline.total) this.t = 0;
    this.playing = true;
    this.last = performance.now();
    const tick = (/** @type {number} */ now) => {
      if (!this.playing) return;
      this.t += (this.rate * Math.max(0, now - this.last)) / 1e3;
      this.last = now;
      if (this.t >= this.timeline.total) {
        this.t = this.timeline.total;
        this.playing = false;
      } else this.frame = requestAnimationFrame(tick);
      this.emit();
    };
    this.frame = requestAnimationFrame(tick);
    this.emit();
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    cancelAnimationFrame(this.frame);
    this.emit();
  }

  /** @param {number} t  s */
  seek(t) {
    this.t = Math.min(Math.max(t, 0), this.timeline.total);
    this.emit();
  }

  /**
   * Go to the next or the previous row of the motion.
   * @param {1 | -1} direction
   */
  step(direction) {
    this.pause();
    const { moment, timeline } = this;
    if (!moment) return;
    const { span, index } = moment;
    const near = 1e-6;
    const times = Array.from(span.time, (time) => span.begin + time);
    const next =
      direction > 0
        ? times.find((time) => time > this.t + near)
        : times.findLast((time) => time < this.t - near);
    if (next !== undefined) this.seek(next);
    else if (direction > 0) this.seek(timeline.spans[index + 1]?.begin ?? timeline.total);
    else this.seek(Math.max(0, span.begin - 2 * near));
  }

  /**
   * Go to the begin of the next or the previous cut.
   * @param {1 | -1} direction
   */
  skip(direction) {
    const begins = this.timeline.spans.filter((s) => s.kind === "cut").map((s) => s.begin);
    const near = direction > 0 ? 1e-3 : 0.3;
    const next =
      direction > 0
        ? begins.find((begin) => begin > this.t + near)
        : begins.findLast((begin) => begin < this.t - near);
    this.seek(next ?? (direction > 0 ? this.timeline.total : 0));
  }
}
