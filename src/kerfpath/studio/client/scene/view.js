/** The view of the cell: it follows the store and the player, and contours can be pointed at. */

import { Box3, Vector3 } from "three";

import { player, store } from "../app.js";
import { byId, floatAt } from "../dom.js";
import { fixed, millimetres, percent } from "../format.js";
import { position } from "../kinematics.js";
import { draw, html, mount, redraw } from "../ui.js";
import { Machine } from "./machine.js";
import { Ghosts } from "./ghosts.js";
import { legend } from "./legend.js";
import { Near } from "./near.js";
import { Picking } from "./picking.js";
import { Paths } from "./paths.js";
import { Placing } from "./placing.js";
import { Stage } from "./stage.js";

/** @typedef {import("../timeline.js").Moment} Moment */

const REACH = 14; // px within which a contour is pointed at

export class SceneView {
  constructor() {
    this.canvas = byId("scene", HTMLCanvasElement);
    this.label = byId("scene-label");
    this.stage = new Stage(this.canvas);
    this.machine = new Machine();
    this.paths = new Paths();
    const { group: lines, beam } = this.paths;
    this.stage.scene.add(this.machine.group, this.machine.ghost, lines, beam);
    this.picking = new Picking(this);
    this.near = new Near(this);
    this.ghosts = new Ghosts(this);
    this.placing = new Placing(this);
    this.built = "";
    this.fitted = ""; // the robot that the view was fitted to
    this.begun = false; // whether the bodies have had a motion of their own
    this.ready = false;
    this.follow = false;
    /** @type {import("../timeline.js").Timeline | null} whose kerf is drawn */
    this.prepared = null;
    this.trouble = "";
    /** @type {ArrayLike<number> | null} where the robot of the plan to compare with is */
    this.other = null;
    this.haunted = false;
    /** @type {Vector3 | null} where the tip was that the camera follows */
    this.carried = null;
    this.paths.paint();
    this.bind();
    mount(byId("scene-state"), () => this.state());
    mount(byId("scene-note"), () => this.note());
    mount(byId("scale"), () => legend(this.paths, this.near.why()));
  }

  bind() {
    const { canvas } = this;
    store.on(["scene"], () => this.build());
    store.on(["scene", "plan", "clearance"], () => this.draw());
    store.on(["selected", "plan"], () => this.mark());
    player.on((moment) => this.show(moment));
    let [x, y] = [0, 0];
    canvas.addEventListener("pointerdown", (event) => ([x, y] = [event.offsetX, event.offsetY]));
    canvas.addEventListener("pointerup", (event) => {
      if (Math.hypot(event.offsetX - x, event.offsetY - y) > 4) return;
      this.clicked(event.offsetX, event.offsetY, event.button === 2);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons === 0) this.point(event.offsetX, event.offsetY);
    });
    canvas.addEventListener("pointerleave", () => {
      this.label.hidden = true;
      if (this.picking.menu.hidden) this.picking.hover(null);
    });
    canvas.addEventListener("keydown", ({ key, ctrlKey, metaKey }) => {
      if (key === "f") this.look("fit");
      if (key === "g" && !ctrlKey && !metaKey) this.ghosts.keep();
    });
    for (const button of document.querySelectorAll("[data-view]")) {
      const { view } = /** @type {HTMLElement} */ (button).dataset;
      button.addEventListener("click", () => this.look(view ?? "fit"));
    }
    const follow = byId("follow");
    follow.addEventListener("click", () => {
      this.follow = !this.follow;
      this.carried = null;
      follow.setAttribute("aria-pressed", String(this.follow));
      if (this.follow) this.look("head");
    });
    const by = byId("colour-by", HTMLSelectElement);
    by.addEventListener("change", () => {
      this.paths.colour(/** @type {import("./paths.js").ColourBy} */ (by.value));
      this.show(player.moment);
    });
    const executed = byId("executed", HTMLSelectElement);
    executed.addEventListener("change", () => {
      this.paths.enlarge(Number(executed.value));
      this.stage.invalidate();
    });
  }

  /**
   * Choose the contour that was clicked, or offer actions for the loop, face or contour.
   * @param {number} x  px
   * @param {number} y  px
   * @param {boolean} right  whether it was the other button
   */
  clicked(x, y, right) {
    if (this.placing.held || this.placing.moved) return;
    const [found, loop] = [this.pointed(x, y), this.picking.pointed(x, y)];
    if (found && right) this.picking.asked(x, y, found.contour);
    else if (found && !(loop && loop.away < found.away)) this.chosen(found.contour, found.node);
    else this.picking.clicked(x, y, loop?.loop ?? null);
  }

  /**
   * Choose what was clicked, and go there.
   * @param {string} contour
   * @param {number} node
   */
  chosen(contour, node) {
    store.select(contour);
    const plan = store.plans.get(contour)?.[0];
    const when = plan && player.timeline.when(plan, Math.min(node, plan.time.length - 1));
    if (when !== null && when !== undefined) player.seek(when);
  }

  /** Build the bodies if they are not the shown ones. */
  async build() {
    const { scene } = store;
    if (!scene) return;
    this.placing.landed();
    const layout = store.job?.values?.layout ?? {};
    const key = JSON.stringify([scene.robot, scene.bodies, layout.standing, layout.move]);
    if (key === this.built) return this.placing.apply();
    const first = this.fitted !== scene.robot.id; // another robot has another size
    this.built = key;
    try {
      this.ghosts.clear();
      await this.machine.build(scene, layout);
      this.trouble = "";
    } catch (fault) {
      this.trouble = fault instanceof Error ? fault.message : String(fault);
      this.built = "";
    }
    if (key !== this.built && this.built) return;
    this.ready = true;
    this.begun = false;
    this.placing.apply();
    this.lay();
    this.show(player.moment);
    if (first || this.stage.held) this.fit(scene.robot.id);
    redraw();
  }

  /**
   * Fit the view to the cell, and keep it whole until a person moves it.
   * @param {string} robot
   */
  fit(robot) {
    this.fitted = robot;
    this.look("fit");
    this.stage.hold();
  }

  /** Whether a contour has a plan for the scene that is shown. */
  get planned() {
    const { scene, plans } = store;
    return [...plans.values()].some(([{ revision }]) => revision >= (scene?.revision ?? 0));
  }

  /** Draw the floor under the bodies of the cell. */
  lay() {
    const { scene } = store;
    if (!scene || !this.ready) return;
    const box = new Box3();
    const still = this.machine.frames.slice(0, this.machine.base + 1);
    for (const body of still.flatMap(({ children }) => children)) box.expandByObject(body);
    this.stage.layFloor(box.expandByScalar(0.5), this.machine.floor);
  }

  /** Draw the contours again. */
  draw() {
    const { scene, plans } = store;
    /** @type {import("./paths.js").Track[]} */
    const tracks = [];
    for (const { name: contour, points, kind } of scene?.contours ?? []) {
      // A plan from before the part was moved is elsewhere.
      const all = plans.get(contour) ?? [];
      const found = all.filter(({ revision }) => revision >= (scene?.revision ?? 0));
      for (const plan of found)
        tracks.push({
          contour,
          plan,
          points: plan.points,
          kind: plan.kind,
          clearance: this.near.along(plan),
        });
      if (!found.length) tracks.push({ contour, plan: null, points, kind, clearance: null });
    }
    this.paths.load(tracks);
    this.paths.choose(store.selected);
    this.stage.invalidate();
  }

  /** Mark the chosen contour, and where it has no path. */
  mark() {
    const { selected, nopaths } = store;
    this.paths.choose(selected);
    this.paths.markAt((selected && nopaths.get(selected)?.point) || null);
    this.stage.invalidate();
  }

  /** @param {Moment | null} moment */
  show(moment) {
    const { scene } = store;
    if (!scene || !this.ready) return;
    if (this.prepared !== player.timeline) {
      this.prepared = player.timeline;
      this.paths.prepare(this.prepared);
    }
    const q = moment?.q ?? scene.sample.q;
    const tip = this.machine.pose(scene.robot, q);
    this.placing.lay();
    const cutting = moment?.span.kind === "cut" || moment?.span.kind === "pierce";
    this.paths.shine(cutting ? tip : null);
    this.paths.cutUntil(moment?.t ?? 0);
    const at = position(tip);
    this.near.show(this.paths.by === "clearance" ? moment : null, at);
    if (this.follow && moment) {
      if (this.carried) this.stage.carry(at.clone().sub(this.carried));
      this.carried = at;
    }
    if (moment && !this.begun && this.planned) {
      this.begun = true;
      if (this.stage.held) this.fit(scene.robot.id); // the arm is elsewhere than before
    }
    this.stage.invalidate();
  }

  /**
   * Show the robot elsewhere as a ghost; null removes it.
   * @param {ArrayLike<number> | null} q
   * @param {boolean} [admitted]
   */
  haunt(q, admitted = true) {
    const { scene } = store;
    this.haunted = q !== null;
    const at = q ?? this.other;
    this.machine.ghost.visible = at !== null;
    if (at && scene) {
      this.machine.pose(scene.robot, at, true);
      this.machine.haunt(q ? admitted : true);
    }
    this.stage.invalidate();
  }

  /**
   * Show the robot of another plan as a ghost, unless a pose is pointed at; null removes it.
   * @param {ArrayLike<number> | null} q
   */
  accompany(q) {
    this.other = q;
    if (!this.haunted) this.haunt(null);
  }

  /** @param {string} view  "fit", "part", "top", ..., "head", or "mark", where the path breaks */
  look(view) {
    const { scene, nopaths, selected } = store;
    if (!scene || !this.ready) return;
    const { moment } = player;
    const tip = this.machine.pose(scene.robot, moment?.q ?? scene.sample.q);
    const head = position(tip);
    const mark = nopaths.get(selected ?? "")?.point;
    const { matrix: there } = this.paths.group;
    if (view === "head") this.carried = head;
    if (view === "head" || (view === "mark" && mark)) {
      const at = view === "mark" && mark ? new Vector3().fromArray(mark).applyMatrix4(there) : head;
      const around = [-1, 1].map((sign) => at.clone().addScalar(0.16 * sign));
      this.stage.look("part", around);
      return;
    }
    /** @type {Vector3[]} */
    const points = [];
    for (const { points: xyz } of [...scene.contours, ...(store.part?.loops ?? [])])
      for (let i = 0; i < xyz.length; i += 3)
        points.push(new Vector3().fromArray(xyz, i).applyMatrix4(there));
    if (view !== "part") points.push(...this.machine.outline());
    if (points.length) this.stage.look(view, points);
  }

  /**
   * Return the contour and node under a place of the canvas, or null.
   * @param {number} x  px
   * @param {number} y  px
   */
  pointed(x, y) {
    const point = new Vector3();
    let best = REACH;
    /** @type {{contour: string, node: number, away: number} | null} */
    let found = null;
    for (const { contour, points } of this.paths.tracks)
      for (let k = 0; k < points.length / 3; k++) {
        point.fromArray(points, 3 * k).applyMatrix4(this.paths.group.matrix);
        const seen = this.stage.project(point);
        const away = Math.hypot(seen.x - x, seen.y - y);
        if (away < best && seen.z < 1) {
          best = away;
          found = { contour, node: k, away };
        }
      }
    return found;
  }

  /**
   * Name the contour under the pointer.
   * @param {number} x
   * @param {number} y
   */
  point(x, y) {
    const busy = this.placing.held || this.placing.moved;
    const near = busy ? null : this.pointed(x, y);
    const loop = busy ? null : this.picking.pointed(x, y);
    const found = loop && loop.away < (near?.away ?? Infinity) ? null : near;
    this.canvas.style.cursor = found || loop ? "pointer" : "";
    if (this.picking.menu.hidden && !found) this.picking.hover(loop?.loop ?? null);
    this.label.hidden = !(found || loop) || !this.picking.menu.hidden;
    if (this.label.hidden) return;
    draw(this.label, found ? this.described(found) : loop && this.picking.words(loop.loop));
    floatAt(this.label, x + 14, y - 40, this.canvas);
  }

  /**
   * The values of a contour at a node.
   * @param {{contour: string, node: number}} found
   */
  described({ contour, node }) {
    const plan = store.plans.get(contour)?.[0];
    if (!plan) return html`<strong>${contour}</strong>`;
    const k = Math.min(node, plan.time.length - 1);
    const speed = fixed(plan.speed[Math.min(k, plan.speed.length - 1)] * 60, 2);
    const load = percent(plan.joint_load[k]);
    return html`
      <strong>${contour}</strong> ${millimetres(plan.s[k])}, ${speed} m/min, joint load ${load}`;
  }

  /** The state while there is no scene. */
  state() {
    const { job, scene, connection, progress } = store;
    byId("view").classList.toggle("ready", this.ready);
    /** @type {(title: string, ...words: string[]) => import("../ui.js").Content} */
    const said = (title, ...words) =>
      html`<strong>${title}</strong>${words.map((each) => html`<p>${each}</p>`)}`;
    if (this.trouble) {
      const again = "Reload the page to try again; planning goes on meanwhile.";
      return said("The cell cannot be drawn", `${this.trouble}. ${again}`);
    }
    if (this.ready) return null;
    if (job?.faults.length && !scene) {
      return said("The job has an error", "It is said above; correct it under Job file.");
    }
    const what = connection === "open" ? "Reading the cell" : "Waiting for the studio's server";
    const step = progress.label || "Robot, head and part appear here once they are read.";
    return html`<div class="spinner" />${said(what, step)}`;
  }

  /** The approximate shapes. */
  note() {
    const bodies = this.ready ? (store.scene?.bodies ?? []) : [];
    const rough = new Set(bodies.flatMap(({ approximate, kind }) => (approximate ? kind : [])));
    return rough.size ? `approximate shapes: ${[...rough].join(", ")}` : "";
  }

  /** Take the colours of the theme. */
  paint() {
    this.machine.paint();
    this.paths.paint();
    this.picking.loops.paint();
    this.ghosts.paint();
    this.placing.paint();
    this.lay();
    this.stage.invalidate();
  }
}
