/** Loops and faces of the part, pointed at and clicked: they become contours of the job. */

import { byId, el, icon } from "../dom.js";
import { counted, millimetres } from "../format.js";
import { barred, cutLoops, described, leaving, uncut } from "../part.js";
import { Loops, faceOf } from "./loops.js";

/** @typedef {import("../messages.js").Loop} Loop */
/** @typedef {import("./view.js").SceneView} SceneView */
/** @typedef {{send: (message: any) => boolean}} Link */

export class Picking {
  /**
   * @param {SceneView} view
   * @param {Link} connection
   */
  constructor(view, connection) {
    this.view = view;
    this.store = view.store;
    this.connection = connection;
    this.loops = new Loops();
    this.loops.paint();
    this.menu = byId("scene-menu");
    this.lit = ""; // the loop under the pointer
    view.stage.scene.add(this.loops.group);
    this.store.on(["part", "scene"], () => this.draw());
    this.store.on(["pointed"], (/** @type {Loop[]} */ loops) => this.light(loops));
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
    this.loops.load(uncut(this.store));
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
    const { stage, machine, store } = this.view;
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
    const beside = uncut(this.store, true).filter((each) => each.face === name && !barred(each));
    if (!loop && !beside.length) return false;
    this.light(loop ? [loop] : beside);
    const all = beside.map((each) => each.name);
    const why = loop ? barred(loop) : "";
    this.open(x, y, loop?.name ?? name, [
      el("p", {}, loop ? described(loop) : `face, ${counted(beside.length, "loop")} of it not cut`),
      why ? el("p", { class: "fault" }, why) : null,
      loop && !why ? this.button("Cut this loop", [loop.name], true) : null,
      all.length > (loop ? 1 : 0)
        ? this.button(`Cut all ${all.length} loops of ${loop ? name : "this face"}`, all, !loop)
        : null,
    ]);
    return true;
  }

  /**
   * Offer to take a contour out of the job.
   * @param {number} x  px
   * @param {number} y  px
   * @param {string} contour
   */
  asked(x, y, contour) {
    const shape = this.store.scene?.contours.find(({ name }) => name === contour);
    if (!shape) return;
    const { words, why } = leaving(this.store, shape.index);
    const out = el(
      "button",
      {
        class: "plain",
        disabled: why !== "",
        onclick: () => {
          this.connection.send({ type: "leave", index: shape.index });
          this.close();
        },
      },
      icon("close"),
      `${words} of the job`,
    );
    const length = shape.s[shape.s.length - 1];
    this.open(x, y, contour, [
      el("p", {}, `${millimetres(length)} long, ${shape.loop}`),
      why ? el("p", {}, why) : null,
      out,
    ]);
  }

  /**
   * @param {string} words
   * @param {string[]} loops
   * @param {boolean} first
   */
  button(words, loops, first) {
    const cut = () => {
      cutLoops(this.store, this.connection, loops);
      this.close();
    };
    return el("button", { class: first ? "primary" : "plain", onclick: cut }, words);
  }

  /**
   * @param {number} x  px
   * @param {number} y  px
   * @param {string} title
   * @param {(HTMLElement | null)[]} body
   */
  open(x, y, title, body) {
    const { menu, view } = this;
    menu.replaceChildren(el("strong", {}, title), ...body.filter((each) => each !== null));
    menu.hidden = false;
    view.label.hidden = true;
    const room = view.canvas;
    const left = Math.min(x + 12, room.clientWidth - menu.offsetWidth - 8);
    const top = Math.min(y + 12, room.clientHeight - menu.offsetHeight - 8);
    menu.style.transform = `translate(${Math.max(8, left)}px, ${Math.max(8, top)}px)`;
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
    return [el("strong", {}, loop.name), ` ${described(loop)}, not cut`];
  }
}
