/** What is said of the loops of the part: which are cut, what each one is, in words. */

import { counted, millimetres } from "./format.js";

/** @typedef {import("./messages.js").Loop} Loop */
/** @typedef {import("./store.js").Store} Store */

/**
 * Return the contours of the job by the loops that they are of.
 * @param {Store} store
 */
export const contoursByLoop = (store) =>
  new Map((store.scene?.contours ?? []).map((each) => [each.loop, each]));

/**
 * Return the loops that no contour of the job is of.
 * @param {Store} store
 * @param {boolean} inside  those on the inner side of a sheet, too
 */
export function uncut(store, inside = false) {
  const known = contoursByLoop(store);
  return (store.part?.loops ?? []).filter(
    ({ name, side }) => !known.has(name) && (inside || side !== "inner"),
  );
}

/**
 * Say what a loop is.
 * @param {Loop} loop
 */
export function kindOf({ kind, diameter }) {
  if (kind === "open") return "open line";
  if (kind === "outer") return "trim line";
  return diameter === null ? "opening" : `hole, diameter ${millimetres(diameter)}`;
}

/**
 * Say what a loop is and how long.
 * @param {Loop} loop
 */
export const described = (loop) => `${kindOf(loop)}, ${millimetres(loop.length)} long`;

/**
 * Return why a loop cannot be cut, "" where it can.
 * @param {Loop} loop
 */
export const barred = ({ kind, closed, gap }) =>
  closed || kind === "open"
    ? ""
    : `has a gap of ${millimetres(gap, 3)}: close it in CAD, or raise gap_mm of the part`;

/**
 * Have loops cut, and the contour of the first one chosen once it is there.
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 * @param {string[]} loops
 */
export function cutLoops(store, connection, loops) {
  store.awaited = loops[0];
  connection.send({ type: "cut", loops });
}

/**
 * Return the words for taking a contour out of the job: its table may be that of several.
 * @param {Store} store
 * @param {number} index
 */
export function leaving(store, index) {
  const contours = store.scene?.contours ?? [];
  const same = contours.filter((each) => each.index === index).length;
  const tables = new Set(contours.map((each) => each.index)).size;
  return {
    words: same > 1 ? `Take out, with the ${counted(same - 1, "other")} of its table` : "Take out",
    why: tables > 1 ? "" : "the only contour of the job stays; add another one first",
  };
}
