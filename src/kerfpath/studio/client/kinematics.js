/** Forward kinematics: the frames of all joints from their angles, as the server's robot has them. */

/** @typedef {import("./messages.js").RobotModel} RobotModel */

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

/** The pose that changes nothing. */
export const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/**
 * Return the frames of the robot: 0 is the base, i moves with joint i, the last is the tip.
 * @param {RobotModel} robot
 * @param {ArrayLike<number>} q  rad
 * @returns {number[][]} n + 2 poses
 */
export function frames(robot, q) {
  const found = [IDENTITY];
  robot.joints.forEach((joint, i) => {
    found.push(multiply(multiply(found[i], joint.T), rotation(joint.axis, q[i])));
  });
  const last = found[found.length - 1];
  found.push(multiply(multiply(last, robot.T_flange), robot.T_tool));
  return found;
}

/**
 * Return where the last entry of ascending `times` is that is not after t, from 0 to length - 2.
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
 * Return the joints at a time, straight between rows.
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
