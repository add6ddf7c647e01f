/** The controls of the player: buttons, the track with the program's segments, clock and speed. */

import { player, store } from "../app.js";
import { byId, freshContext, themeColour } from "../dom.js";
import { clock, counted, fixed } from "../format.js";
import { draw, fill, html, icon } from "../ui.js";

/** How each kind of segment is named and coloured. */
const KINDS = {
  move: { words: "transfer move", colour: "--moving" },
  approach: { words: "approach", colour: "--moving" },
  pierce: { words: "piercing", colour: "--pierce" },
  cut: { words: "cutting", colour: "--cut" },
  retract: { words: "retract", colour: "--moving" },
};

export class Track {
  constructor() {
    this.strip = byId("strip", HTMLCanvasElement);
    this.scrub = byId("scrub", HTMLInputElement);
    this.drawn = "";
    byId("previous").addEventListener("click", () => player.skip(-1));
    byId("next").addEventListener("click", () => player.skip(1));
    byId("toggle").addEventListener("click", () => player.toggle());
    this.scrub.addEventListener("input", () => {
      player.pause();
      player.seek(Number(this.scrub.value));
    });
    const rate = byId("rate", HTMLSelectElement);
    rate.addEventListener("change", () => (player.rate = Number(rate.value)));
    player.on(() => this.show());
    store.on(["selected"], () => this.draw());
    new ResizeObserver(() => this.draw()).observe(this.strip);
    this.show();
  }

  show() {
    const { scrub } = this;
    const { timeline, playing, moment } = player;
    for (const id of ["previous", "next", "toggle"]) byId(id, HTMLButtonElement).disabled = !moment;
    const [toggle, words] = [byId("toggle"), playing ? "Pause" : "Play"];
    if (toggle.title !== `${words} (Space)`) {
      toggle.title = `${words} (Space)`;
      toggle.setAttribute("aria-label", words);
      draw(toggle, html`${icon(playing ? "pause" : "play")}`);
    }
    scrub.disabled = !moment;
    scrub.max = String(timeline.total || 1);
    scrub.value = String(player.t);
    fill(scrub);
    byId("clock").textContent = `${clock(player.t)} / ${clock(timeline.total)}`;
    const where = byId("where");
    const span = moment?.span;
    where.textContent = span
      ? `${KINDS[span.kind].words} ${span.contour ?? ""}`.trim()
      : "no motion yet";
    where.title =
      moment && !timeline.whole
        ? "Only the cuts so far: transfer moves follow with the program."
        : "";
    const at = `${fixed(player.t)} s of ${fixed(timeline.total)} s, ${where.textContent}`;
    if (moment) scrub.setAttribute("aria-valuetext", at);
    if (this.key !== this.drawn) this.draw();
  }

  /** What the strip depends on. */
  get key() {
    const { spans, total } = player.timeline;
    return `${spans.length} ${total} ${store.selected}`;
  }

  /** Draw the segments: cuts in colour, those of the chosen contour strongest, moves thin. */
  draw() {
    const { timeline } = player;
    this.drawn = this.key;
    const context = freshContext(this.strip);
    if (!context) return;
    const { clientWidth: width, clientHeight: height } = this.strip;
    const thumb = 0.55 * parseFloat(getComputedStyle(this.strip).fontSize);
    const scale = (width - 2 * thumb) / (timeline.total || 1);
    for (const { kind, begin, end, contour } of timeline.spans) {
      const cut = kind === "cut" || kind === "pierce";
      const tall = cut ? height * 0.5 : height * 0.16;
      context.globalAlpha = cut && contour !== store.selected ? 0.45 : 1;
      context.fillStyle = themeColour(KINDS[kind].colour);
      const wide = Math.max(1, (end - begin) * scale - 0.75);
      context.fillRect(thumb + begin * scale, (height - tall) / 2, wide, tall);
    }
    const cuts = timeline.spans.filter(({ kind }) => kind === "cut").length;
    this.strip.setAttribute("aria-label", counted(cuts, "cut"));
  }
}
