/** Loops and faces of the part, pointed at and clicked: they become contours of the job. */

import { send, store } from "../app.js";
import { byId, floatAt } from "../dom.js";
import { counted, millimetres } from "../format.js";
import { switchContour } from "../job.js";
import { barred, cutLoops, described, leaving, uncut } from "../part.js";
import { draw, html, icon } from "../ui.js";
import { Loops, faceOf } from "./loops.js";

/** @typedef {import("../messages.js").LoopEntry} Loop */
/** @typedef {import("./view.js").SceneView} SceneView */

export class Picking {
  /** @param {SceneView} view */
  constructor(view) {
    this.view = view;
    this.loops = new Loops();
    this.loops.paint();
    this.menu = byId("scene-menu");
    this.lit = ""; // the loop under the pointer
    view.stage.scene.add(this.loops.group);
    store.on(["part", "scene"], () => this.draw());
    store.on(["pointed"], (/** @type {Loop[]} */ loops) => this.light(loops));
    this.menu.addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      this.close();
      view.canvas.focus();
      event.stopPropagation();
    });
    document.addEventListener("pointerdown", (event) => {
      if (!(/** @type {Element} */ (event.target).closest("#scene-menu"))) this.close();
    });
  }

  /** Draw the loops that are not cut. */
  draw() {
    this.loops.load(uncut());
    this.close();
    this.view.stage.invalidate();
  }

  /** @param {Loop[]} loops */
  light(loops) {
    this.loops.light(loops);
    this.view.stage.invalidate();
  }

  /**
   * Return the loop under a place of the canvas and its distance in px, or null.
   * @param {number} x  px
   * @param {number} y  px
   */
  pointed(x, y) {
    const { stage, machine } = this.view;
    if (!this.loops.shown.length || !machine.frames.length) return null;
    const part = machine.carried[0].children.find(({ name }) => name === "part");
    const hit = part ? this.loops.struck(stage, x, y, part) : null;
    return this.loops.pointed(stage, x, y, hit?.distance ?? Infinity);
  }

  /**
   * Return the name of the face of the part under a place of the canvas, or "".
   * @param {number} x  px
   * @param {number} y  px
   */
  face(x, y) {
    const { stage, machine } = this.view;
    const hit = this.loops.struck(stage, x, y, machine.group);
    if (!store.part || hit?.object.name !== "part") return "";
    return faceOf(store.part, hit.faceIndex ?? -1);
  }

  /**
   * Offer the actions for the loop or the face that was clicked.
   * @param {number} x  px
   * @param {number} y  px
   * @param {Loop | null} loop
   */
  clicked(x, y, loop) {
    const name = loop?.face ?? this.face(x, y);
    const beside = uncut(true).filter((each) => each.face === name && !barred(each));
    if (!loop && !beside.length) return false;
    this.light(loop ? [loop] : beside);
    const all = beside.map((each) => each.name);
    const why = loop ? barred(loop) : "";
    const about = loop ? described(loop) : `face, ${counted(beside.length, "loop")} of it not cut`;
    const whole = `Cut all ${all.length} loops of ${loop ? name : "this face"}`;
    const several = all.length > (loop ? 1 : 0);
    this.open(
      x,
      y,
      html`
        <strong>${loop?.name ?? name}</strong>
        <p>${about}</p>
        ${why && html`<p class="fault">${why}</p>`}
        ${loop && !why && this.button("Cut this loop", [loop.name], "primary")}
        ${several && this.button(whole, all, loop ? "plain" : "primary")}`,
    );
    return true;
  }

  /**
   * Offer to take a contour out of the job.
   * @param {number} x  px
   * @param {number} y  px
   * @param {string} contour
   */
  asked(x, y, contour) {
    const shape = store.scene?.contours.find(({ name }) => name === contour);
    if (!shape) return;
    const { index, loop, s } = shape;
    const { words, why } = leaving(index);
    const leave = () => {
      send({ type: "leave", index });
      this.close();
    };
    const skip = () => {
      switchContour(contour, false);
      this.close();
    };
    const only = store.scene?.contours.length === 1;
    this.open(
      x,
      y,
      html`
        <strong>${contour}</strong>
        <p>${millimetres(s[s.length - 1])} long, ${loop}</p>
        ${why && html`<p>${why}</p>`}
        <button class="plain" disabled=${only} onClick=${skip}>Do not cut it for now</button>
        <button class="plain" disabled=${why !== ""} onClick=${leave}>
          ${icon("close")}${words} of the job
        </button>`,
    );
  }

  /** @type {(words: string, loops: string[], kind: "plain" | "primary") => unknown} */
  button(words, loops, kind) {
    const cut = () => {
      cutLoops(loops);
      this.close();
    };
    return html`<button class=${kind} onClick=${cut}>${words}</button>`;
  }

  /** @type {(x: number, y: number, content: import("../ui.js").Content) => void} */
  open(x, y, content) {
    const { menu, view } = this;
    draw(menu, content);
    menu.hidden = false;
    view.label.hidden = true;
    floatAt(menu, x + 12, y + 12, view.canvas);
    /** @type {HTMLElement | null} */ (menu.querySelector("button:not(:disabled)"))?.focus();
  }

  close() {
    if (this.menu.hidden) return;
    this.menu.hidden = true;
    this.light([]);
  }

  /**
   * Highlight the loop under the pointer.
   * @param {Loop | null} loop
   */
  hover(loop) {
    const name = loop?.name ?? "";
    if (name === this.lit) return;
    this.lit = name;
    this.light(loop ? [loop] : []);
  }

  /**
   * Return the label of a loop.
   * @param {Loop} loop
   */
  words(loop) {
    return html`<strong>${loop.name}</strong> ${described(loop)}, not cut`;
  }
}
