/** The loops of the part that are not cut: thin lines, some highlighted, and the one pointed at. */

import { Group, Raycaster, Vector2 } from "three";

import { fill, line, paintLines } from "./paths.js";

/** @import { Intersection, Object3D } from "three" */
/** @typedef {import("../messages.js").LoopEntry} Loop */
/** @typedef {import("../messages.js").PartMessage} PartMessage */
/** @typedef {import("./stage.js").Stage} Stage */

const REACH = 9; // px within which a loop is pointed at
const THICK = 0.015; // m by which a loop may lie behind the surface that is pointed at

export class Loops {
  constructor() {
    this.group = new Group();
    this.all = line(1.5, "--quiet", 1, { opacity: 0.85 });
    this.lit = line(4.5, "--accent", 6);
    this.group.add(this.all, this.lit);
    /** @type {Loop[]} those that are shown */
    this.shown = [];
    this.ray = new Raycaster();
    Object.assign(this.ray.params, { Line2: { threshold: 2 * REACH } }); // px, on both sides together
  }

  /** Take the colours and the text size of the theme. */
  paint() {
    paintLines([this.all, this.lit]);
  }

  /** @param {Loop[]} loops */
  load(loops) {
    this.shown = loops;
    fill(this.all, loops);
  }

  /** @param {Loop[]} loops  none: no loop is lit */
  light(loops) {
    fill(this.lit, loops);
  }

  /**
   * Return what is hit under a place of the canvas, the nearest first.
   * @param {Stage} stage
   * @param {number} x  px
   * @param {number} y  px
   * @param {Object3D} among
   */
  hits({ size, camera }, x, y, among) {
    camera.updateMatrixWorld();
    this.ray.setFromCamera(new Vector2((2 * x) / size.x - 1, 1 - (2 * y) / size.y), camera);
    return this.ray.intersectObject(among, true);
  }

  /** @type {(stage: Stage, x: number, y: number, among: Object3D) => Intersection | null} a mesh */
  struck(stage, x, y, among) {
    return this.hits(stage, x, y, among).find(({ object }) => "isMesh" in object) ?? null;
  }

  /**
   * Return the loop under a place of the canvas and its distance in px, or null.
   * @param {Stage} stage
   * @param {number} x  px
   * @param {number} y  px
   * @param {number} deepest  m from the camera, beyond which what is hit hides it
   */
  pointed(stage, x, y, deepest) {
    /** @type {{loop: Loop, away: number} | null} */
    let best = null;
    for (const { faceIndex, pointOnLine, distance } of this.hits(stage, x, y, this.all)) {
      const loop = owner(this.shown, ({ points }) => points.length / 3 - 1, faceIndex ?? -1);
      if (!loop || !pointOnLine || distance > deepest + THICK) continue;
      const seen = stage.project(pointOnLine);
      const away = Math.hypot(seen.x - x, seen.y - y);
      if (away < (best?.away ?? REACH)) best = { loop, away };
    }
    return best;
  }
}

/**
 * Return the entry that a segment or triangle belongs to, from how many each entry has.
 * @template T
 * @param {T[]} entries
 * @param {(entry: T) => number} count
 * @param {number} index
 */
function owner(entries, count, index) {
  let end = 0;
  return entries.find((each) => index < (end += count(each)));
}

/**
 * Return the name of the face that a triangle of the part's mesh belongs to, or "".
 * @param {PartMessage} part
 * @param {number} triangle
 */
export const faceOf = ({ faces }, triangle) =>
  owner(faces, ({ triangles }) => triangles, triangle)?.name ?? "";
