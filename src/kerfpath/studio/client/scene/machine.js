/** Robot, head, part, fixtures: bodies that stand still or move with a joint, and the robot's ghost. */

import {
  BufferAttribute,
  BufferGeometry,
  Color,
  Group,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  Vector3,
} from "three";

import { themeColour } from "../dom.js";
import { frames } from "../kinematics.js";
import { creased, merged, mesh } from "./meshes.js";

/** @typedef {import("../messages.js").SceneMessage} SceneMessage */
/** @typedef {import("../messages.js").Body} Body */
/** @typedef {Body["kind"]} Kind */

/** @type {Record<Kind, string>} */
const COLOURS = {
  robot: "--robot",
  head: "--head",
  part: "--part",
  fixture: "--fixture",
  floor: "--fixture",
};
const MOST_EDGES = 60000;

/**
 * What moves a body: a joint, the part with what holds it, or nothing. A floor goes with the base.
 * @param {Body} body
 * @param {string[]} standing  names of the fixtures that do not go with the part
 * @returns {number | "carried" | "standing"}
 */
const carrier = ({ kind, name, frame }, standing) =>
  kind === "part" || (kind === "fixture" && !standing.includes(name))
    ? "carried"
    : kind === "fixture"
      ? "standing"
      : frame;

/**
 * Return the matrix of a pose.
 * @param {ArrayLike<number>} pose  16, row-major
 */
export const matrix = (pose) => new Matrix4().fromArray(Array.from(pose)).transpose();

export class Machine {
  constructor() {
    this.group = new Group();
    this.ghost = new Group();
    this.ghost.visible = false;
    /** @type {Group[]} */
    this.frames = [];
    /** @type {Group[]} */
    this.ghostFrames = [];
    /** The part with its fixtures, and the fixtures that do not go with it; both in the base. */
    this.carried = new Group();
    this.standing = new Group();
    /** The part where the job has it, seen while it is shown elsewhere. */
    this.left = new Group();
    this.left.visible = false;
    this.carried.matrixAutoUpdate = this.standing.matrixAutoUpdate = false;
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
    this.edge = new LineBasicMaterial({ transparent: true, opacity: 0.55 });
    // The veil only writes how far away the ghost is, so that of its links the nearest is seen.
    this.veil = new MeshBasicMaterial({ colorWrite: false, transparent: true });
    this.ghostMaterial = new MeshStandardMaterial({
      transparent: true,
      opacity: 0.42,
      roughness: 0.8,
    });
    this.leftMaterial = new MeshBasicMaterial({
      transparent: true,
      opacity: 0.22,
      depthWrite: false,
    });
    this.triangles = 0;
    this.paint();
  }

  /** Take the colours of the theme. */
  paint() {
    for (const [kind, material] of Object.entries(this.materials))
      material.color = new Color(themeColour(COLOURS[/** @type {Kind} */ (kind)]));
    this.edge.color = new Color(themeColour("--edge"));
    this.leftMaterial.color = new Color(themeColour("--part"));
    this.ghostMaterial.color = new Color(themeColour("--ghost"));
  }

  /**
   * Build the bodies of a scene; resolves once all are there.
   * @param {SceneMessage} scene
   * @param {string[]} standing  names of the fixtures that do not go with the part
   */
  async build(scene, standing) {
    /** @type {Map<string, Body[]>} */
    const groups = new Map();
    for (const body of scene.bodies) {
      const key = `${carrier(body, standing)} ${body.kind} ${body.approximate}`;
      groups.set(key, [...(groups.get(key) ?? []), body]);
    }
    const made = await Promise.all(
      [...groups.values()].map(async (bodies) => ({
        // What stands in for a shape that is not known has no edges that would mean anything.
        ...creased(
          merged(await Promise.all(bodies.map((body) => mesh(body.mesh)))),
          bodies[0].approximate && bodies[0].kind === "robot" ? Math.PI / 2 : undefined,
        ),
        edged: !(bodies[0].approximate && bodies[0].kind === "robot"),
        by: carrier(bodies[0], standing),
        kind: bodies[0].kind,
      })),
    );
    this.clear();
    for (let i = 0; i <= scene.robot.joints.length; i++) {
      const [frame, ghost] = [new Group(), new Group()];
      frame.matrixAutoUpdate = ghost.matrixAutoUpdate = false;
      this.group.add(frame);
      this.ghost.add(ghost);
      this.frames.push(frame);
      this.ghostFrames.push(ghost);
    }
    this.frames[0].add(this.carried, this.standing);
    this.standing.add(this.left);
    this.triangles = 0;
    for (const { faces, edges, edged, by, kind } of made) {
      const parent = typeof by === "number" ? this.frames[by] : this[by];
      const body = new Mesh(faces, this.materials[kind]);
      body.name = kind;
      parent.add(body);
      this.triangles += faces.getAttribute("position").count / 3;
      if (edged && edges.length && edges.length / 6 < MOST_EDGES) {
        const lines = new BufferGeometry();
        lines.setAttribute("position", new BufferAttribute(edges, 3));
        parent.add(new LineSegments(lines, this.edge));
      }
      if (kind === "part") {
        const left = new Mesh(faces, this.leftMaterial);
        left.raycast = () => {}; // nobody points at it
        this.left.add(left);
      }
      if (typeof by === "number" && kind !== "floor")
        for (const [order, material] of [this.veil, this.ghostMaterial].entries()) {
          const part = new Mesh(faces, material);
          part.renderOrder = 10 + order;
          this.ghostFrames[by].add(part);
        }
    }
  }

  clear() {
    this.group.traverse((each) => {
      if (each instanceof Mesh || each instanceof LineSegments) each.geometry.dispose();
    });
    this.group.clear();
    this.ghost.clear();
    this.carried.clear();
    this.standing.clear();
    this.left.clear();
    this.frames = [];
    this.ghostFrames = [];
  }

  /**
   * Put the robot, or its ghost, where its joints say; returns the pose of the tip.
   * @param {SceneMessage["robot"]} robot
   * @param {ArrayLike<number>} q
   * @param {boolean} [ghost]
   */
  pose(robot, q, ghost = false) {
    const found = frames(robot, q);
    const groups = ghost ? this.ghostFrames : this.frames;
    groups.forEach((group, i) => {
      group.matrix.copy(matrix(found[i]));
      group.matrixWorldNeedsUpdate = true;
    });
    return found[found.length - 1];
  }

  /** Return points all over the bodies, in the base: enough to see how far they reach. */
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
   * Show the ghost in the colour of what may be, or of what may not.
   * @param {boolean} admitted
   */
  haunt(admitted) {
    this.ghostMaterial.color.set(themeColour(admitted ? "--ghost" : "--ghost-bad"));
    this.ghost.visible = true;
  }
}
