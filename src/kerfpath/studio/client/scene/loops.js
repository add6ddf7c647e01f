/** The loops of the part that are not cut: thin lines, some highlighted, and the one pointed at. */

import { Group, Raycaster, Vector2, Vector3 } from "three";

import { fill, line, paintLines } from "./paths.js";

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
   * Return the first hit under a place of the canvas, and its distance; null: nothing.
   * @param {Stage} stage
   * @param {number} x  px
   * @param {number} y  px
   * @param {import("three").Object3D} among
   */
  struck(stage, x, y, among) {
    const { size, camera } = stage;
    this.ray.setFromCamera(new Vector2((2 * x) / size.x - 1, 1 - (2 * y) / size.y), camera);
    const hits = this.ray.intersectObject(among, true);
    return hits.find(({ object }) => "isMesh" in object) ?? null;
  }

  /**
   * Return the loop under a place of the canvas and its distance in px, or null.
   * @param {Stage} stage
   * @param {number} x  px
   * @param {number} y  px
   * @param {number} deepest  m from the camera, beyond which what is hit hides it
   */
  pointed(stage, x, y, deepest) {
    const { camera, size } = stage;
    camera.updateMatrixWorld();
    const seen = camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse);
    const m = seen.multiply(this.group.matrix).elements;
    const at = new Vector3();
    /** @type {{loop: Loop, away: number} | null} */
    let best = null;
    for (const loop of this.shown) {
      const { points } = loop;
      let [px, py, behind] = [0, 0, true];
      for (let i = 0; i < points.length; i += 3) {
        const [a, b, c] = [points[i], points[i + 1], points[i + 2]];
        const w = m[3] * a + m[7] * b + m[11] * c + m[15];
        const sx = (((m[0] * a + m[4] * b + m[8] * c + m[12]) / w + 1) / 2) * size.x;
        const sy = ((1 - (m[1] * a + m[5] * b + m[9] * c + m[13]) / w) / 2) * size.y;
        const away = behind ? Infinity : toSegment(x, y, px, py, sx, sy);
        [px, py, behind] = [sx, sy, w <= 0];
        if (away >= (best?.away ?? REACH)) continue;
        at.set(a, b, c).applyMatrix4(this.group.matrix);
        if (at.distanceTo(camera.position) > deepest + THICK) continue;
        best = { loop, away };
      }
    }
    return best;
  }
}

/**
 * Return the name of the face that a triangle of the part's mesh belongs to, or "".
 * @param {PartMessage} part
 * @param {number} triangle
 */
export function faceOf(part, triangle) {
  let end = 0;
  for (const { name, triangles } of part.faces) {
    end += triangles;
    if (triangle < end) return name;
  }
  return "";
}

/**
 * Return the distance of a point from a segment.
 * @param {number} x
 * @param {number} y
 * @param {number} ax
 * @param {number} ay
 * @param {number} bx
 * @param {number} by
 */
function toSegment(x, y, ax, ay, bx, by) {
  const [dx, dy] = [bx - ax, by - ay];
  const square = dx * dx + dy * dy;
  const share = square ? ((x - ax) * dx + (y - ay) * dy) / square : 0;
  const u = Math.min(1, Math.max(0, share));
  return Math.hypot(x - ax - u * dx, y - ay - u * dy);
}
