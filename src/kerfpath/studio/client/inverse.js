/** Inverse kinematics near a known pose, for turning the tool about its beam (Newton's method). */

import { Vector3 } from "three";

import { baseOf, frames, position, product, rotation } from "./kinematics.js";

/** @typedef {import("./messages.js").RobotEntry} RobotModel */
/** @typedef {import("three").Matrix4} Matrix4 */

const STRIDE = 0.1; // rad of the beam's rotation from one solution to the next
const FAR = 0.6; // rad that a joint may move in one stride: more means a singularity is near
const ENOUGH = 1e-7; // m and rad: far below what is visible

/**
 * Return the joints after turning the tool about its beam with the tip fixed. Newton's method runs
 * in strides, so that the posture stays. External axes do not move. Null if it does not converge.
 * @param {RobotModel} robot  of six joints, and external axes
 * @param {ArrayLike<number>} from  rad or m
 * @param {number} angle  rad
 * @returns {number[] | null}
 */
export function turnedAbout(robot, from, angle) {
  const base = baseOf(robot);
  if (robot.joints.length - base !== 6) return null;
  let q = Array.from(from);
  const tip = frames(robot, q)[robot.joints.length + 1];
  const strides = Math.max(1, Math.ceil(Math.abs(angle) / STRIDE));
  for (let i = 1; i <= strides; i++) {
    const next = newton(robot, base, q, product(tip, rotation([0, 0, 1], (angle * i) / strides)));
    if (!next || next.some((each, j) => Math.abs(each - q[j]) > FAR)) return null;
    q = next;
  }
  return q;
}

/**
 * Return joints that reach a pose of the tip, from nearby joints, or null.
 * @param {RobotModel} robot
 * @param {number} base  its frame
 * @param {number[]} from
 * @param {Matrix4} goal
 */
function newton(robot, base, from, goal) {
  const q = [...from];
  for (let turn = 0; turn < 8; turn++) {
    const found = frames(robot, q);
    const tip = found[found.length - 1];
    const error = difference(tip, goal);
    if (Math.max(...error.map(Math.abs)) < ENOUGH) return q;
    const columns = robot.joints.slice(0, 6).map(({ axis }, i) => {
      const frame = found[base + i + 1];
      const z = new Vector3().fromArray(axis).transformDirection(frame);
      return [...z.clone().cross(position(tip).sub(position(frame))), ...z];
    });
    const step = solved(columns, error);
    if (!step) return null;
    step.forEach((each, j) => (q[j] += each));
  }
  return null;
}

/**
 * Return the difference of two poses: m along the axes, rad about them.
 * @param {Matrix4} from
 * @param {Matrix4} to
 */
function difference(from, to) {
  const turn = new Vector3();
  for (let c = 0; c < 3; c++) {
    const [a, b] = [from, to].map((pose) => new Vector3().setFromMatrixColumn(pose, c));
    turn.addScaledVector(a.cross(b), 0.5);
  }
  return [...position(to).sub(position(from)), ...turn];
}

/**
 * Solve columns * x = right by elimination with pivoting; null if the matrix is singular.
 * @param {number[][]} columns
 * @param {number[]} right
 * @returns {number[] | null}
 */
function solved(columns, right) {
  const n = right.length;
  const rows = right.map((value, r) => [...columns.map((column) => column[r]), value]);
  for (let i = 0; i < n; i++) {
    let pivot = i;
    for (let r = i + 1; r < n; r++) if (Math.abs(rows[r][i]) > Math.abs(rows[pivot][i])) pivot = r;
    if (Math.abs(rows[pivot][i]) < 1e-9) return null;
    [rows[i], rows[pivot]] = [rows[pivot], rows[i]];
    for (let r = i + 1; r < n; r++) {
      const share = rows[r][i] / rows[i][i];
      for (let c = i; c <= n; c++) rows[r][c] -= share * rows[i][c];
    }
  }
  const x = new Array(n).fill(0);
  for (let i = n - 1; i >= 0; i--) {
    let sum = rows[i][n];
    for (let c = i + 1; c < n; c++) sum -= rows[i][c] * x[c];
    x[i] = sum / rows[i][i];
  }
  return x;
}
