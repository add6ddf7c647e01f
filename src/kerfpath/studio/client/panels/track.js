/** The controls of the player: buttons, the track with the program's segments, clock and speed. */

import { byId, fitCanvas, icon, themeColour } from "../dom.js";
import { clock, counted, fixed } from "../format.js";
import { fill } from "./fields.js";

/** @typedef {import("../player.js").Player} Player */
/** @typedef {import("../timeline.js").Moment} Moment */
/** @typedef {import("../store.js").Store} Store */

const WORDS = {
  move: "transfer move",
  approach: "approach",
  pierce: "piercing",
  cut: "cutting",
  retract: "retract",
};
const COLOURS = {
  move: "--moving",
  approach: "--moving",
  pierce: "--pierce",
  cut: "--cut",
  retract: "--moving",
};

export class Track {
  /**
   * @param {Player} player
   * @param {Store} store
   */
  constructor(player, store) {
    this.player = player;
    this.store = store;
    this.strip = byId("strip", HTMLCanvasElement);
    this.scrub = byId("scrub", HTMLInputElement);
    this.toggle = byId("toggle", HTMLButtonElement);
    this.shown = "";
    for (const name of ["previous", "next"]) byId(name).append(icon(name));
    byId("previous").addEventListener("click", () => player.skip(-1));
    byId("next").addEventListener("click", () => player.skip(1));
    this.toggle.addEventListener("click", () => player.toggle());
    this.scrub.addEventListener("input", () => {
      player.pause();
      player.seek(Number(this.scrub.value));
    });
    const rate = byId("rate", HTMLSelectElement);
    rate.addEventListener("change", () => (player.rate = Number(rate.value)));
    player.on((moment) => this.show(moment));
    store.on(["selected"], () => this.draw());
    new ResizeObserver(() => this.draw()).observe(this.strip);
    this.show(player.moment);
  }

  /** @param {Moment | null} moment */
  show(moment) {
    const { player, toggle, scrub } = this;
    const { timeline, playing } = player;
    const off = !moment;
    for (const id of ["previous", "next", "toggle"]) byId(id, HTMLButtonElement).disabled = off;
    const mode = playing ? "pause" : "play";
    if (toggle.dataset.mode !== mode) {
      toggle.dataset.mode = mode;
      toggle.replaceChildren(icon(mode));
      toggle.setAttribute("aria-label", playing ? "Pause" : "Play");
      toggle.title = playing ? "Pause (Space)" : "Play (Space)";
    }
    scrub.disabled = off;
    scrub.max = String(timeline.total || 1);
    scrub.value = String(player.t);
    fill(scrub);
    byId("clock").textContent = `${clock(player.t)} / ${clock(timeline.total)}`;
    const where = byId("where");
    if (!moment) where.textContent = "no motion yet";
    else {
      const { span } = moment;
      const words = WORDS[span.kind];
      where.textContent = span.contour ? `${words} ${span.contour}` : words;
      where.title = timeline.whole
        ? ""
        : "Only the cuts so far: transfer moves follow with the program.";
      scrub.setAttribute(
        "aria-valuetext",
        `${fixed(player.t)} s of ${fixed(timeline.total)} s, ${where.textContent}`,
      );
    }
    const key = `${timeline.spans.length} ${timeline.total} ${this.store.selected}`;
    if (key !== this.shown) this.draw();
  }

  /** Draw the segments: cuts in colour, those of the chosen contour strongest, moves thin. */
  draw() {
    const { timeline } = this.player;
    this.shown = `${timeline.spans.length} ${timeline.total} ${this.store.selected}`;
    const { width, height, ratio } = fitCanvas(this.strip);
    const context = this.strip.getContext("2d");
    if (!context || !width) return;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const thumb = 0.55 * parseFloat(getComputedStyle(this.strip).fontSize);
    const scale = (width - 2 * thumb) / (timeline.total || 1);
    for (const { kind, begin, end, contour } of timeline.spans) {
      const cut = kind === "cut" || kind === "pierce";
      const tall = cut ? height * 0.5 : height * 0.16;
      context.globalAlpha = cut && contour !== this.store.selected ? 0.45 : 1;
      context.fillStyle = themeColour(COLOURS[kind]);
      context.fillRect(
        thumb + begin * scale,
        (height - tall) / 2,
        Math.max(1, (end - begin) * scale - 0.75),
        tall,
      );
    }
    const moves = timeline.spans.filter(({ kind }) => kind === "cut").length;
    this.strip.setAttribute("aria-label", counted(moves, "cut"));
  }
}
