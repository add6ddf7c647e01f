/** Moving the part or the robot by handles: the scene meanwhile, and the reach there. */

import { Euler, Group, Matrix4, Object3D, Vector3 } from "three";
import { TransformControls } from "three/addons/controls/TransformControls.js";

import { store } from "../app.js";
import { matrix } from "../kinematics.js";
import { fill, line, paintLines } from "./paths.js";

/** @typedef {import("./view.js").SceneView} SceneView */
/** @typedef {import("../messages.js").ReachMessage} ReachMessage */
/** @typedef {"part" | "robot"} What */
/** @typedef {Record<string, number>} Offsets mm and deg by the variables of a layout */

const MM = 1e3;
const DEG = 180 / Math.PI;

/**
 * Return the pose of a position and roll, pitch and yaw of a job.
 * @param {number[]} xyz  mm
 * @param {number[]} rpy  deg
 */
function poseOf(xyz, rpy) {
  const [roll, pitch, yaw] = rpy.map((each) => each / DEG);
  const turn = new Matrix4().makeRotationFromEuler(new Euler(roll, pitch, yaw, "ZYX"));
  return turn.setPosition(new Vector3().fromArray(xyz.map((each) => each / MM)));
}

/**
 * Return position and roll, pitch and yaw of a pose, in the convention of a job.
 * @param {Matrix4} pose
 * @returns {{xyz: number[], rpy: number[]}} mm, deg
 */
function numbersOf(pose) {
  const { x, y, z } = new Euler().setFromRotationMatrix(pose, "ZYX");
  const at = new Vector3().setFromMatrixPosition(pose).toArray();
  return {
    xyz: at.map((each) => rounded(each * MM, 3)),
    rpy: [x, y, z].map((each) => rounded(each * DEG, 4)),
  };
}

/** @type {(value: number, places: number) => number} */
const rounded = (value, places) => Number(value.toFixed(places)) + 0;

export class Placing {
  /** @param {SceneView} view */
  constructor(view) {
    this.view = view;
    this.open = false;
    /** @type {What} */
    this.what = "part";
    /** The moves of the part and of the robot's base in the scene. */
    this.part = new Matrix4();
    this.base = new Matrix4();
    this.mount = 0; // deg, of the head
    /** Whether the shown move has been sent to the job, and whether it has not been sent yet. */
    this.awaits = false;
    this.fresh = false;
    this.middle = new Vector3();
    /** @type {{xyz: number[], rpy: number[]} | null} place of the part in the job */
    this.numbers = null;
    /** Pose of the part in the scene. */
    this.there = new Matrix4();
    /** Moves by external axes: of the frame of the part, of the part in it, and of the base. */
    this.turned = new Matrix4();
    this.inside = new Matrix4();
    this.railed = new Matrix4();
    this.handle = new Object3D();
    this.group = new Group();
    this.group.matrixAutoUpdate = false;
    this.reached = line(3.6, "--accent", 7);
    this.lost = line(7, "--alert", 8);
    this.group.add(this.reached, this.lost);
    const { stage } = view;
    this.gizmo = new TransformControls(stage.camera, stage.canvas);
    this.gizmo.setSize(0.9);
    this.gizmo.showE = this.gizmo.showXYZE = false;
    stage.scene.add(this.handle, this.group);
    /** @type {ReachMessage | null} */
    this.reach = null;
    /** Called after each move by hand; with true when the handle is released. @type {(done: boolean) => void} */
    this.dragged = () => {};
    this.gizmo.addEventListener("change", () => stage.invalidate());
    this.gizmo.addEventListener("dragging-changed", ({ value }) => {
      stage.controls.enabled = !value;
      if (!value && this.moved) this.dragged(true);
    });
    this.gizmo.addEventListener("objectChange", () => {
      this.handle.updateMatrix();
      const { matrix: at } = this.handle;
      if (this.what === "robot") this.base.copy(at).multiply(this.railed.clone().invert());
      else {
        const away = new Matrix4().setPosition(this.carriedMiddle().negate());
        this.part.copy(this.turned).invert().multiply(at).multiply(away);
      }
      this.fresh = true;
      this.apply();
      this.dragged(false);
    });
  }

  /** Whether anything has been moved from its place in the job. */
  get moved() {
    return Object.keys(this.offsets()).length > 0;
  }

  /** Whether the pointer is on a handle, or drags it. */
  get held() {
    return this.open && (this.gizmo.dragging || this.gizmo.axis !== null);
  }

  /** @param {boolean} open  whether there are handles */
  show(open) {
    this.open = open;
    const { scene } = this.view.stage;
    if (open) {
      this.gizmo.attach(this.handle);
      scene.add(this.gizmo.getHelper());
    } else {
      this.gizmo.detach();
      scene.remove(this.gizmo.getHelper());
      this.reset();
    }
    this.paint();
    this.draw();
  }

  /**
   * Choose what the handles move, and whether they turn it.
   * @param {What} what
   * @param {boolean} turns
   */
  choose(what, turns) {
    this.what = what;
    this.gizmo.setMode(turns ? "rotate" : "translate");
    this.gizmo.showX = this.gizmo.showY = !(turns && what === "robot");
    this.apply();
  }

  /**
   * Return the offsets from the placement of the job; zero offsets are left out.
   * @returns {Offsets}
   */
  offsets() {
    const shift = this.middle.clone().applyMatrix4(this.part).sub(this.middle);
    const turn = numbersOf(this.part).rpy;
    const base = numbersOf(this.base);
    const all = {
      ...{ x_mm: shift.x * MM, y_mm: shift.y * MM, z_mm: shift.z * MM },
      ...{ tilt_x_deg: turn[0], tilt_y_deg: turn[1], yaw_deg: turn[2] },
      ...{ base_x_mm: base.xyz[0], base_y_mm: base.xyz[1], base_z_mm: base.xyz[2] },
      ...{ base_yaw_deg: base.rpy[2], mount_deg: this.mount },
    };
    const known = Object.entries(all).map(([name, value]) => [name, rounded(value, 4)]);
    return Object.fromEntries(known.filter(([, value]) => value !== 0));
  }

  /** The place of the part in the keys of the job, or null. */
  get place() {
    if (!this.numbers) return null;
    const { xyz, rpy } = this.numbers;
    const moved = this.base.clone().invert().multiply(this.part);
    return numbersOf(moved.multiply(poseOf(xyz, rpy)));
  }

  /**
   * Move the part to a place in the keys of a job.
   * @param {number[]} xyz  mm
   * @param {number[]} rpy  deg
   */
  put(xyz, rpy) {
    if (!this.numbers) return;
    const from = poseOf(this.numbers.xyz, this.numbers.rpy).invert();
    this.part.copy(this.base).multiply(poseOf(xyz, rpy)).multiply(from);
    this.fresh = true;
    this.apply();
  }

  /**
   * Move the robot's base and its head.
   * @param {number[]} xyz  mm
   * @param {number} yaw  deg
   * @param {number} mount  deg
   */
  moveRobot(xyz, yaw, mount) {
    this.base.copy(poseOf(xyz, [0, 0, yaw]));
    this.mount = mount;
    this.fresh = true;
    this.apply();
  }

  /**
   * Show a placement that was tried.
   * @param {import("../messages.js").TryEntry} tried
   */
  preview({ part, rest, offsets }) {
    this.base.copy(matrix(rest)).invert();
    this.part.copy(this.base).multiply(matrix(part));
    this.mount = offsets.mount_deg ?? 0;
    this.fresh = true;
    this.apply();
  }

  /**
   * Note that the shown move has been sent.
   * @param {boolean} awaits  whether sending succeeded
   */
  sent(awaits) {
    this.awaits = awaits;
    this.fresh = false;
  }

  /** Go back to the placement of the job. */
  reset() {
    this.clear();
    this.apply();
  }

  clear() {
    this.part.identity();
    this.base.identity();
    this.mount = 0;
    this.fresh = false;
  }

  /** Take a new scene: it contains the move that was sent; a move that was not sent is kept. */
  landed() {
    const { stage } = this.view;
    const away = this.base.clone().invert();
    const still = away.equals(new Matrix4());
    if (!this.fresh && !still) stage.move(away);
    const there = matrix(store.scene?.T_part ?? []);
    const motion = there.clone().multiply(this.there.invert());
    this.there = there;
    this.middle.applyMatrix4(motion);
    const { xyz_mm, rpy_deg } = store.job?.values?.part ?? {};
    this.numbers = xyz_mm && rpy_deg ? { xyz: xyz_mm, rpy: rpy_deg } : null;
    this.reach = null;
    if (this.fresh && still) this.part.multiply(motion.invert());
    else this.clear();
    this.lay();
    this.draw();
  }

  /**
   * Take the answer on reach.
   * @param {ReachMessage} reach
   */
  take(reach) {
    this.reach = reach;
    if (!this.gizmo.dragging) {
      this.middle.fromArray(reach.middle);
      this.apply();
    }
    this.draw();
  }

  /** Colour the nodes by whether they are in reach. */
  draw() {
    /** @type {{points: number[]}[][]} stretches in reach, and those out of it */
    const stretches = [[], []];
    for (const { name, points } of (this.open && this.reach && store.scene?.contours) || []) {
      const lost = new Set(this.reach?.contours.find((each) => each.name === name)?.out);
      for (let k = 0; 3 * k + 5 < points.length; k++)
        stretches[lost.has(k) || lost.has(k + 1) ? 1 : 0].push({
          points: points.slice(3 * k, 3 * k + 6),
        });
    }
    fill(this.reached, stretches[0]);
    fill(this.lost, stretches[1]);
    this.view.stage.invalidate();
  }

  /** Move everything in the scene to its current place. */
  apply() {
    const { machine } = this.view;
    machine.group.matrixAutoUpdate = false;
    set(machine.group, this.base);
    machine.left.visible = this.moved;
    this.lay();
  }

  /** The middle of the part, in the frame that it is placed in. */
  carriedMiddle() {
    return this.middle.clone().applyMatrix4(this.inside);
  }

  /** Move part and fixtures, lines and handles; only the robot moves with its base. */
  lay() {
    const { machine, paths, picking, stage } = this.view;
    const { frames, ground, moved } = machine;
    if (frames.length) {
      this.turned.copy(frames[moved].matrix);
      this.inside.copy(this.turned).invert().multiply(frames[0].matrix);
      this.railed.copy(frames[machine.base].matrix);
    }
    const motion = this.turned.clone().multiply(this.part).multiply(this.turned.clone().invert());
    frames.slice(0, ground + 1).forEach(({ matrix: at }, i) => {
      const seen = this.base.clone().multiply(at).invert();
      set(machine.standing[i], seen.clone().multiply(at));
      set(machine.carried[i], seen.multiply(motion).multiply(at));
    });
    const there = this.turned.clone().multiply(this.part).multiply(this.inside);
    for (const each of [paths.group, picking.loops.group, this.group]) {
      each.matrixAutoUpdate = false;
      set(each, there);
    }
    if (this.moved) paths.shine(null);
    if (!this.gizmo.dragging) {
      const at = this.carriedMiddle().applyMatrix4(this.part);
      const part = this.turned.clone().multiply(this.part.clone().setPosition(at));
      const whole = this.what === "robot" ? this.base.clone().multiply(this.railed) : part;
      whole.decompose(this.handle.position, this.handle.quaternion, new Vector3());
    }
    stage.invalidate();
  }

  /** Take the colours and the text size of the theme. */
  paint() {
    paintLines([this.reached, this.lost]);
  }
}

/** @type {(target: Object3D, at: Matrix4) => void} */
function set(target, at) {
  target.matrix.copy(at);
  target.matrixWorldNeedsUpdate = true;
}
