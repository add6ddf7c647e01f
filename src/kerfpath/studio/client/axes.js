/** Joints and external axes as the page tells of them: their names, units and colours. */

import { UNITS } from "./format.js";

/**
 * @typedef {object} Axis
 * @property {string} label  where there is little room: "J1", an external axis by its name
 * @property {string} unit  of its values as they are told: deg or mm
 * @property {(value: number) => number} of  what rad or m are in it
 * @property {string} colour  a variable of the theme
 * @property {boolean} external
 */

/**
 * Return the axes of a robot in the order of its joints.
 * @param {import("./messages.js").RobotModel | undefined} robot
 * @returns {Axis[]}
 */
export function axesOf(robot) {
  const arm = robot?.joints.filter(({ carries }) => !carries).length ?? 0;
  return (robot?.joints ?? []).map(({ name, unit, carries }, j) => ({
    ...UNITS[unit],
    label: carries ? name : `J${j + 1}`,
    colour: carries ? `--external-${j - arm + 1}` : `--joint-${j + 1}`,
    external: carries !== null,
  }));
}
