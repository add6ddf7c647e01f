/** The nearest pair of bodies: both highlighted, with their distance beside the tip. */

import { Mesh, MeshBasicMaterial, Vector3 } from "three";

import { store } from "../app.js";
import { byId, floatAt, themeColour } from "../dom.js";
import { millimetres } from "../format.js";
import { draw, html } from "../ui.js";
import { creased, mesh } from "./meshes.js";

/** @typedef {import("../messages.js").PlanMessage} PlanMessage */
/** @typedef {import("../timeline.js").Moment} Moment */
/** @typedef {import("./view.js").SceneView} SceneView */

export class Near {
  /** @param {SceneView} view */
  constructor(view) {
    this.view = view;
    this.label = byId("near");
    this.at = new Vector3();
    this.material = new MeshBasicMaterial({ transparent: true, opacity: 0.45, depthWrite: false });
    /** @type {Mesh[]} */
    this.lit = [];
    this.shown = "";
    view.stage.controls.addEventListener("change", () => this.place());
  }

  /**
   * Return the distances along a plan in m, or null where they are not known.
   * @param {PlanMessage} plan
   */
  along(plan) {
    const known = store.clearanceOf(plan);
    return known && known.distance.map((each) => each ?? Infinity);
  }

  /** Return why there are no distances. */
  why() {
    return store.scene?.cell
      ? "distances are computed once all contours are planned"
      : "the job has no [cell]: no distances are computed";
  }

  /**
   * Highlight the nearest pair at a moment and show its distance; null: none.
   * @param {Moment | null} moment
   * @param {Vector3} at  the tip
   */
  show(moment, at) {
    const plan = moment?.span.plan;
    const known = plan && store.clearanceOf(plan);
    const k = moment?.node ?? 0;
    const distance = known ? known.distance[k] : null;
    this.label.hidden = !known || distance === null;
    const pair = known && distance !== null ? known.pairs[known.pair[k]] : [];
    this.light(pair);
    if (!known || distance === null) return;
    const [one, other] = pair;
    const over = known.over[k] ?? 0;
    this.label.classList.toggle("bad", over <= 0);
    draw(
      this.label,
      html`
        <b>${millimetres(distance)}</b>: ${one} – ${other}
        ${over <= 0 && html`<small> closer than allowed</small>`}`,
    );
    this.at.copy(at);
    this.place();
  }

  /** Place the label beside the tip. */
  place() {
    if (this.label.hidden) return;
    const { stage, canvas } = this.view;
    stage.camera.updateMatrixWorld();
    const { x, y } = stage.project(this.at);
    floatAt(this.label, x + 18, y - 44, canvas);
  }

  /**
   * Highlight bodies by their names; the part is drawn as one body.
   * @param {string[]} names
   */
  async light(names) {
    const key = names.join("\n");
    if (key === this.shown) return;
    this.shown = key;
    const { machine, stage } = this.view;
    for (const each of this.lit.splice(0)) {
      each.removeFromParent();
      each.geometry.dispose();
    }
    this.material.color.set(themeColour("--caution-line"));
    const bodies = (store.scene?.bodies ?? []).filter(({ name }) =>
      // A link is drawn as one, however many shapes it is checked with.
      names.some((each) => each === name || each.startsWith(`${name} `)),
    );
    const made = await Promise.all(
      bodies.map(async (body) => creased(await mesh(body.mesh)).faces),
    );
    if (key !== this.shown) return made.forEach((each) => each.dispose());
    bodies.forEach(({ frame }, i) => {
      const lit = new Mesh(made[i], this.material);
      lit.renderOrder = 8;
      machine.frames[frame]?.add(lit);
      this.lit.push(lit);
    });
    stage.invalidate();
    return undefined;
  }
}
