/** Joints and external axes as the page shows them: their names, units and colours. */

import { shownUnit } from "./format.js";

/**
 * @typedef {object} Axis
 * @property {string} label  short: "J1", or the name of an external axis
 * @property {string} unit  the shown unit of its values: deg or mm
 * @property {(value: number) => number} of  converts rad or m to that unit
 * @property {string} colour  a variable of the theme
 * @property {boolean} external
 */

/**
 * Return the axes of a robot in the order of its joints.
 * @param {import("./messages.js").RobotEntry | undefined} robot
 * @returns {Axis[]}
 */
export function axesOf(robot) {
  const arm = robot?.joints.filter(({ carries }) => !carries).length ?? 0;
  return (robot?.joints ?? []).map(({ name, unit, carries }, j) => ({
    ...shownUnit(unit),
    label: carries ? name : `J${j + 1}`,
    colour: carries ? `--external-${j - arm + 1}` : `--joint-${j + 1}`,
    external: carries !== null,
  }));
}
