/** Forward kinematics: the frames of all joints from their values, for the robot of the server. */

import { Matrix4, Vector3 } from "three";

/** @typedef {import("./messages.js").RobotEntry} RobotModel */

/**
 * Return the matrix of a pose.
 * @param {number[]} pose  16, row-major
 */
export const matrix = (pose) => new Matrix4().fromArray(pose).transpose();

/** @type {(first: Matrix4, ...more: Matrix4[]) => Matrix4} */
export const product = (first, ...more) =>
  more.reduce((found, each) => found.multiply(each), first.clone());

/**
 * Return the position of a pose.
 * @param {Matrix4} pose
 */
export const position = (pose) => new Vector3().setFromMatrixPosition(pose);

/**
 * Return the rotation by an angle about a unit vector, as a pose.
 * @param {number[]} axis
 * @param {number} angle  rad
 */
export const rotation = (axis, angle) =>
  new Matrix4().makeRotationAxis(new Vector3().fromArray(axis), angle);

/**
 * Return the pose by which an external axis has moved what it carries.
 * @param {import("./messages.js").JointEntry} joint
 * @param {number} value  rad or m
 */
function motion({ T, axis, unit }, value) {
  const move = new Matrix4();
  if (unit === "m") return move.setPosition(new Vector3().fromArray(axis).multiplyScalar(value));
  const point = move.setPosition(position(matrix(T)));
  return product(point, rotation(axis, value), point.clone().invert());
}

/**
 * Return the index of the fixed frame, which is the number of axes that carry the part.
 * @param {RobotModel} robot
 */
export const groundOf = ({ joints }) => joints.filter(({ carries }) => carries === "part").length;

/**
 * Return the index of the robot's base frame, which is the number of external axes.
 * @param {RobotModel} robot
 */
export const baseOf = ({ joints }) => joints.filter(({ carries }) => carries).length;

/**
 * Return the frames of the robot in the room: from the part over the ground to the base, then of
 * each joint, and last the tip. Without external axes the first one is ground and base.
 * @param {RobotModel} robot
 * @param {ArrayLike<number>} q  rad or m
 * @returns {Matrix4[]} n + 2 poses
 */
export function frames({ joints, T_flange, T_tool }, q) {
  /** @type {(what: "part" | "robot") => Matrix4[]} poses of what 0, 1, ... axes carry */
  const carried = (what) =>
    joints.reduce(
      (found, joint, i) =>
        joint.carries === what
          ? [...found, product(found[found.length - 1], motion(joint, q[i]))]
          : found,
      [new Matrix4()],
    );
  const found = [...carried("part").reverse(), ...carried("robot").slice(1)];
  joints.forEach(({ carries, T, axis }, i) => {
    if (carries) return;
    found.push(product(found[found.length - 1], matrix(T), rotation(axis, q[i])));
  });
  found.push(product(found[found.length - 1], matrix(T_flange), matrix(T_tool)));
  return found;
}

/**
 * Return the index of the last of ascending `times` that is not after t, from 0 to length - 2.
 * @param {ArrayLike<number>} times
 * @param {number} t
 * @returns {number}
 */
export function interval(times, t) {
  let low = 0;
  let high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle;
    else high = middle;
  }
  return low;
}

/**
 * Return the joints at a time, interpolated linearly between rows.
 * @param {ArrayLike<number>} times  m, s, ascending
 * @param {ArrayLike<number>} q  m n, row-major
 * @param {number} joints  n
 * @param {number} t
 * @returns {number[]}
 */
export function jointsAt(times, q, joints, t) {
  if (times.length === 1) return Array.from({ length: joints }, (_, j) => q[j]);
  const i = interval(times, t);
  const span = times[i + 1] - times[i];
  const u = span > 0 ? Math.min(1, Math.max(0, (t - times[i]) / span)) : 1;
  const [from, to] = [i * joints, (i + 1) * joints];
  return Array.from({ length: joints }, (_, j) => q[from + j] + u * (q[to + j] - q[from + j]));
}
