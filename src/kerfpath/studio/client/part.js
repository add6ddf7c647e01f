/** The loops of the part: which are cut, and descriptions in words. */

import { send, store } from "./app.js";
import { counted, millimetres } from "./format.js";

/** @typedef {import("./messages.js").LoopEntry} Loop */

/** Return the contours of the job by their loops. */
export const contoursByLoop = () =>
  new Map((store.scene?.contours ?? []).map((each) => [each.loop, each]));

/**
 * Return the loops that are not cut.
 * @param {boolean} [inside]  whether to include the inner side of a sheet
 */
export function uncut(inside = false) {
  const known = contoursByLoop();
  return (store.part?.loops ?? []).filter(
    ({ name, side }) => !known.has(name) && (inside || side !== "inner"),
  );
}

/**
 * Return the kind of a loop in words.
 * @param {Loop} loop
 */
function kindOf({ kind, diameter }) {
  if (kind === "open") return "open line";
  if (kind === "outer") return "trim line";
  return diameter === null ? "opening" : `hole, diameter ${millimetres(diameter)}`;
}

/**
 * Return the kind and the length of a loop in words.
 * @param {Loop} loop
 */
export const described = (loop) => `${kindOf(loop)}, ${millimetres(loop.length)} long`;

/**
 * Return why a loop cannot be cut, or "".
 * @param {Loop} loop
 */
export const barred = ({ kind, closed, gap }) =>
  closed || kind === "open"
    ? ""
    : `has a gap of ${millimetres(gap, 3)}: close it in CAD, or raise gap_mm of the part`;

/**
 * Ask the server to cut loops; the contour of the first one is chosen once it exists.
 * @param {string[]} loops
 */
export function cutLoops(loops) {
  store.awaited = loops[0];
  send({ type: "cut", loops });
}

/**
 * Return the words for taking a contour out of the job; its table may pick several contours.
 * @param {number} index
 */
export function leaving(index) {
  const contours = store.scene?.contours ?? [];
  const same = contours.filter((each) => each.index === index).length;
  const tables = new Set(contours.map((each) => each.index)).size;
  return {
    words: same > 1 ? `Take out, with the ${counted(same - 1, "other")} of its table` : "Take out",
    why: tables > 1 ? "" : "a job needs at least one contour; add another one first",
  };
}
