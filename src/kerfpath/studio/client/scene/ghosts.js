/** Ghosts that stay: copies of all moving bodies at chosen poses, until they are cleared. */

import { Group, Mesh, MeshStandardMaterial } from "three";

import { player, store } from "../app.js";
import { byId, themeColour } from "../dom.js";
import { counted } from "../format.js";

/** @typedef {import("./view.js").SceneView} SceneView */

const MOST = 6; // each is some twenty draw calls

export class Ghosts {
  /** @param {SceneView} view */
  constructor(view) {
    this.view = view;
    this.group = new Group();
    this.material = new MeshStandardMaterial({ transparent: true, opacity: 0.3, roughness: 0.8 });
    view.stage.scene.add(this.group);
    this.button = byId("ghosts-clear");
    byId("ghost-keep").addEventListener("click", () => this.keep());
    this.button.addEventListener("click", () => this.clear());
    this.paint();
  }

  /** Take the colours of the theme. */
  paint() {
    this.material.color.set(themeColour("--moving"));
  }

  /** Keep a ghost where the robot is; if there are too many, the oldest is removed. */
  keep() {
    const { machine, stage } = this.view;
    const { moment } = player;
    if (!store.scene || !moment || !machine.ghostFrames.length) return;
    const before = machine.ghostFrames.map(({ matrix }) => matrix.clone());
    machine.pose(store.scene.robot, moment.q, true);
    const kept = machine.ghost.clone();
    machine.ghostFrames.forEach(({ matrix }, i) => matrix.copy(before[i]));
    kept.traverse((each) => {
      each.visible = true;
      if (each instanceof Mesh && each.material === machine.ghostMaterial)
        each.material = this.material;
    });
    this.group.add(kept);
    if (this.group.children.length > MOST) this.group.remove(this.group.children[0]);
    this.say();
    stage.invalidate();
  }

  /** Remove all ghosts. */
  clear() {
    this.group.clear();
    this.say();
    this.view.stage.invalidate();
  }

  say() {
    const count = this.group.children.length;
    this.button.hidden = count === 0;
    this.button.textContent = `Clear ${counted(count, "ghost")}`;
  }
}
