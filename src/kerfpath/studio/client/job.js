/** The keys of the job: their values, what is wrong with them, and edits. */

import { send, store } from "./app.js";

/** @typedef {import("./messages.js").Edit["path"]} Path */

/**
 * Return the path of a dotted key; "contour.x" is x of the chosen contour's table.
 * @param {string} key
 * @returns {Path}
 */
function pathOf(key) {
  const [first, ...rest] = key.split(".");
  const inner = rest.map((part) => (/^\d+$/.test(part) ? Number(part) : part));
  return first === "contour" ? [first, store.table ?? 0, ...inner] : [first, ...inner];
}

/**
 * Return the value of a key, or null; while the job has a fault, that of the job before.
 * @param {string} key
 */
export function valueOf(key) {
  /** @type {any} */
  let found = store.valid?.values;
  for (const part of pathOf(key)) found = found?.[part];
  return found ?? null;
}

/**
 * Whether a key is in the text of the job.
 * @param {string} key
 */
export const isGiven = (key) => store.valid?.given.includes(pathOf(key).join(".")) ?? false;

/**
 * Return what is wrong with a key, or "".
 * @param {string} key
 */
export function faultOf(key) {
  const path = pathOf(key).join(".");
  return store.job?.faults.find((each) => each.key.join(".") === path)?.message ?? "";
}

/** @returns {string[]} the names of the contours that are not cut */
export const switchedOff = () => valueOf("part.switched_off") ?? [];

/**
 * Switch a contour on or off.
 * @param {string} name
 * @param {boolean} on
 */
export function switchContour(name, on) {
  const others = switchedOff().filter((each) => each !== name);
  const off = on ? others : [...others, name];
  setKeys(["part.switched_off", off.length ? off : null]);
}

/**
 * Set a key; null removes it. Edits with the same gesture are one step of undo.
 * @param {string} key
 * @param {unknown} value
 * @param {string} gesture
 */
export const setKey = (key, value, gesture) =>
  send({ type: "edit", path: pathOf(key), value, gesture });

/**
 * Set several keys in one step of undo.
 * @param {...[string, unknown]} changes
 */
export const setKeys = (...changes) =>
  send({ type: "edits", edits: changes.map(([key, value]) => ({ path: pathOf(key), value })) });
