/** Forward kinematics: the frames of all joints from their values, for the robot of the server. */

/** @typedef {import("./messages.js").RobotEntry} RobotModel */

/**
 * Return the product of two poses.
 * @param {ArrayLike<number>} a  16, row-major
 * @param {ArrayLike<number>} b  16, row-major
 * @returns {number[]}
 */
export function multiply(a, b) {
  const out = new Array(16);
  for (let row = 0; row < 4; row++)
    for (let column = 0; column < 4; column++) {
      let sum = 0;
      for (let i = 0; i < 4; i++) sum += a[4 * row + i] * b[4 * i + column];
      out[4 * row + column] = sum;
    }
  return out;
}

/**
 * Return the rotation by an angle about a unit vector (Rodrigues), as a pose.
 * @param {ArrayLike<number>} axis
 * @param {number} angle  rad
 * @returns {number[]}
 */
export function rotation(axis, angle) {
  const [x, y, z] = [axis[0], axis[1], axis[2]];
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const t = 1 - c;
  return [
    ...[t * x * x + c, t * x * y - s * z, t * x * z + s * y, 0],
    ...[t * x * y + s * z, t * y * y + c, t * y * z - s * x, 0],
    ...[t * x * z - s * y, t * y * z + s * x, t * z * z + c, 0],
    ...[0, 0, 0, 1],
  ];
}

/** The identity pose. */
const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/**
 * Return the pose by which an external axis has moved what it carries.
 * @param {import("./messages.js").JointEntry} joint
 * @param {number} value  rad or m
 */
function motion({ T, axis, unit }, value) {
  const pose = unit === "m" ? [...IDENTITY] : rotation(axis, value);
  const [x, y, z] = [T[3], T[7], T[11]];
  [0, 1, 2].forEach((r) => {
    const [a, b, c] = [pose[4 * r], pose[4 * r + 1], pose[4 * r + 2]];
    pose[4 * r + 3] = unit === "m" ? value * axis[r] : T[4 * r + 3] - (a * x + b * y + c * z);
  });
  return pose;
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
 * @returns {number[][]} n + 2 poses
 */
export function frames({ joints, T_flange, T_tool }, q) {
  /** @type {(what: "part" | "robot") => number[][]} poses of what 0, 1, ... axes carry */
  const carried = (what) =>
    joints.reduce(
      (found, joint, i) =>
        joint.carries === what
          ? [...found, multiply(found[found.length - 1], motion(joint, q[i]))]
          : found,
      [IDENTITY],
    );
  const found = [...carried("part").reverse(), ...carried("robot").slice(1)];
  joints.forEach(({ carries, T, axis }, i) => {
    if (carries) return;
    found.push(multiply(multiply(found[found.length - 1], T), rotation(axis, q[i])));
  });
  found.push(multiply(multiply(found[found.length - 1], T_flange), T_tool));
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
