/** Robot, head, part and fixtures: bodies that are fixed or move with an axis, and their ghost. */

import {
  BufferAttribute,
  BufferGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  Vector3,
} from "three";

import { themeColour } from "../dom.js";
import { baseOf, frames, groundOf } from "../kinematics.js";
import { creased, merged, mesh } from "./meshes.js";

/** @typedef {import("../messages.js").SceneMessage} SceneMessage */
/** @typedef {import("../messages.js").BodyEntry} Body */
/** @typedef {Body["kind"]} Kind */

/** @type {Record<string, string>} by kind; a floor is drawn by its squares */
const COLOURS = {
  robot: "--robot",
  head: "--head",
  part: "--part",
  fixture: "--fixture",
};
const MOST_EDGES = 60000;
const BELOW = -0.001; // m, so that what stands on the floor hides its squares

/** @typedef {{standing?: string[], move?: string}} Layout  from [layout] */

/**
 * Return the index of the frame in which the part is moved: 0, or the frame before the `move` axis.
 * @param {SceneMessage["robot"]} robot
 * @param {Layout} layout
 */
function placedIn({ joints }, { move }) {
  const axes = joints.filter(({ carries }) => carries === "part");
  const first = axes.findIndex(({ name }) => name === move);
  return first < 0 ? 0 : axes.length - first;
}

/**
 * Return what a body moves with in another placement: the part, the fixed bodies, or the robot.
 * @param {Body} body
 * @param {SceneMessage["robot"]} robot
 * @param {Layout} layout
 * @returns {"carried" | "standing" | "frames"}
 */
function goesWith({ kind, name, frame }, robot, layout) {
  const [ground, moved] = [groundOf(robot), placedIn(robot, layout)];
  if (kind === "part") return "carried";
  if (kind !== "fixture" || frame > ground) return "frames";
  if (layout.standing?.includes(name)) return "standing";
  const alone = moved === 0 && ground > 0; // the part is moved on its axis
  const goes = alone ? frame < ground : frame < moved || frame === ground;
  return goes ? "carried" : "standing";
}

export class Machine {
  constructor() {
    this.group = new Group();
    this.ghost = new Group();
    this.ghost.visible = false;
    /** @type {Group[]} */
    this.frames = [];
    /** @type {Group[]} */
    this.ghostFrames = [];
    /** @type {Group[]} in each frame the part and what goes with it where it is placed elsewhere */
    this.carried = [];
    /** @type {Group[]} in each frame the fixtures that do not go with the part */
    this.standing = [];
    this.ground = 0; // the fixed frame
    this.base = 0; // the frame of the robot's base
    this.floor = BELOW; // the height of its squares, m
    this.moved = 0; // the frame in which the part is moved
    /** The part in the placement of the job, visible while it is shown elsewhere. */
    this.left = new Group();
    this.left.visible = false;
    /** @type {Record<Kind, MeshStandardMaterial>} */
    this.materials = /** @type {any} */ ({});
    for (const kind of /** @type {Kind[]} */ (Object.keys(COLOURS))) {
      this.materials[kind] = new MeshStandardMaterial({
        roughness: kind === "part" ? 0.42 : 0.62,
        metalness: kind === "part" ? 0.25 : 0.05,
        polygonOffset: true,
        polygonOffsetFactor: 1.5,
        polygonOffsetUnits: 2,
        side: kind === "part" ? 2 : 0,
      });
    }
    /** @type {Map<string, MeshStandardMaterial>} by their own colour */
    this.colours = new Map();
    this.edge = new LineBasicMaterial({ transparent: true, opacity: 0.55 });
    // The veil only writes the depth of the ghost, so that only its nearest link is visible.
    this.veil = new MeshBasicMaterial({ colorWrite: false, transparent: true });
    const clear = { transparent: true };
    this.ghostMaterial = new MeshStandardMaterial({ ...clear, opacity: 0.42, roughness: 0.8 });
    this.leftMaterial = new MeshBasicMaterial({ ...clear, opacity: 0.22, depthWrite: false });
    this.triangles = 0;
    this.paint();
  }

  /** Take the colours of the theme. */
  paint() {
    for (const [kind, material] of Object.entries(this.materials))
      material.color.set(themeColour(COLOURS[kind]));
    this.edge.color.set(themeColour("--edge"));
    this.leftMaterial.color.set(themeColour("--part"));
    this.ghostMaterial.color.set(themeColour("--ghost"));
  }

  /**
   * Build the bodies of a scene; resolves once all are there.
   * @param {SceneMessage} scene
   * @param {Layout} layout
   */
  async build(scene, layout) {
    const bodies = scene.bodies.filter(({ kind }) => kind !== "floor");
    const floor = scene.bodies.find(({ kind }) => kind === "floor");
    const slab = floor && (await mesh(floor.mesh));
    const groups = Map.groupBy(bodies, (body) =>
      [body.frame, goesWith(body, scene.robot, layout), body.kind, body.colour].join(" "),
    );
    const made = await Promise.all(
      [...groups.values()].map(async (bodies) => {
        const [body] = bodies;
        const { frame, kind, colour } = body;
        const whole = merged(await Promise.all(bodies.map((each) => mesh(each.mesh))));
        return { ...creased(whole), frame, kind, colour, by: goesWith(body, scene.robot, layout) };
      }),
    );
    this.clear();
    this.ground = groundOf(scene.robot);
    this.base = baseOf(scene.robot);
    this.moved = placedIn(scene.robot, layout);
    for (let i = 0; i <= scene.robot.joints.length; i++) {
      const [frame, carried, standing, ghost] = Array.from({ length: 4 }, () => new Group());
      for (const each of [frame, carried, standing, ghost]) each.matrixAutoUpdate = false;
      this.group.add(frame.add(carried, standing));
      this.ghost.add(ghost);
      this.frames.push(frame);
      this.carried.push(carried);
      this.standing.push(standing);
      this.ghostFrames.push(ghost);
    }
    this.standing[0].add(this.left);
    this.triangles = 0;
    this.floor = BELOW + (slab ? Math.max(...slab.xyz.filter((_, i) => i % 3 === 2)) : 0);
    for (const { faces, edges, by, frame, kind, colour } of made) {
      const parent = this[by][frame];
      const body = new Mesh(faces, this.coloured(kind, colour));
      body.name = kind;
      parent.add(body);
      this.triangles += faces.getAttribute("position").count / 3;
      if (edges.length && edges.length / 6 < MOST_EDGES) {
        const lines = new BufferGeometry();
        lines.setAttribute("position", new BufferAttribute(edges, 3));
        parent.add(new LineSegments(lines, this.edge));
      }
      if (kind === "part") {
        const left = new Mesh(faces, this.leftMaterial);
        left.raycast = () => {}; // it cannot be pointed at
        this.left.add(left);
      }
      if (by === "frames" || frame !== this.ground)
        for (const [order, material] of [this.veil, this.ghostMaterial].entries()) {
          const part = new Mesh(faces, material);
          part.renderOrder = 10 + order;
          this.ghostFrames[frame].add(part);
        }
    }
  }

  /**
   * Return the material of a kind of bodies, or of those of a colour of their own.
   * @param {Kind} kind
   * @param {string} colour
   */
  coloured(kind, colour) {
    if (!colour) return this.materials[kind];
    let own = this.colours.get(colour);
    if (!own) {
      own = this.materials[kind].clone();
      own.color.set(colour);
      this.colours.set(colour, own);
    }
    return own;
  }

  clear() {
    this.group.traverse((each) => {
      if (each instanceof Mesh || each instanceof LineSegments) each.geometry.dispose();
    });
    this.group.clear();
    this.ghost.clear();
    this.left.clear();
    this.frames = [];
    this.carried = [];
    this.standing = [];
    this.ghostFrames = [];
  }

  /**
   * Move all moving bodies, or their ghost, to a joint vector; return the pose of the tip.
   * @param {SceneMessage["robot"]} robot
   * @param {ArrayLike<number>} q
   * @param {boolean} [ghost]
   */
  pose(robot, q, ghost = false) {
    const found = frames(robot, q);
    const groups = ghost ? this.ghostFrames : this.frames;
    // Until a robot with other joints is built, the previous one stays.
    const built = groups.length === found.length - 1 ? groups : [];
    built.forEach((group, i) => {
      group.matrix.copy(found[i]);
      group.matrixWorldNeedsUpdate = true;
      // Hide the ghost of the part where it coincides with the part.
      if (ghost && i < this.ground) group.visible = !group.matrix.equals(this.frames[i].matrix);
    });
    return found[found.length - 1];
  }

  /** Return points of all bodies, in the room, to find their extent. */
  outline() {
    this.group.updateMatrixWorld(true);
    /** @type {Vector3[]} */
    const found = [];
    this.group.traverse((each) => {
      if (!(each instanceof Mesh)) return;
      const at = each.geometry.getAttribute("position");
      const stride = Math.max(1, Math.floor(at.count / 600));
      for (let i = 0; i < at.count; i += stride)
        found.push(new Vector3().fromBufferAttribute(at, i).applyMatrix4(each.matrixWorld));
    });
    return found;
  }

  /**
   * Show the ghost in the colour of admitted or of lost poses.
   * @param {boolean} admitted
   */
  haunt(admitted) {
    this.ghostMaterial.color.set(themeColour(admitted ? "--ghost" : "--ghost-bad"));
    this.ghost.visible = true;
  }
}
