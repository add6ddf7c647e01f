/** Two plans of a contour in figures: criterion by criterion, and joint by joint. */

import { el } from "../dom.js";
import { deg, digits, fixed } from "../format.js";

/** @typedef {import("../messages.js").PlanMessage} PlanMessage */
/** @typedef {import("../messages.js").KeptEntry} KeptEntry */
/** @typedef {"displacement" | "range" | "peak_velocity" | "peak_acceleration"} OfJoint */

/**
 * @typedef {object} Row
 * @property {string} name
 * @property {string} unit
 * @property {number | null} then  of the plan that is compared
 * @property {number | null} now
 * @property {1 | -1 | 0} better  1: where it is more, -1: where it is less
 * @property {number} [places]  default: three digits that count
 */

/** @type {Record<OfJoint, {title: string, unit: string, name: string}>} */
export const OF_JOINT = {
  displacement: { title: "Moves", unit: "deg", name: "moves" },
  range: { title: "Range", unit: "deg", name: "range" },
  peak_velocity: { title: "Speed", unit: "% limit", name: "top speed" },
  peak_acceleration: { title: "Accel.", unit: "% limit", name: "top acceleration" },
};

const sum = (/** @type {number[]} */ values) => values.reduce((total, each) => total + each, 0);

/**
 * Return a criterion of a joint over all pieces of a contour, in deg or % of its limit.
 * @param {PlanMessage[]} plans
 * @param {OfJoint} kind
 * @param {number} joint
 */
function ofJoint(plans, kind, joint) {
  const values = plans.map(({ criteria }) => criteria[kind][joint]);
  if (kind === "displacement") return deg(sum(values));
  return kind === "range" ? deg(Math.max(...values)) : 100 * Math.max(...values);
}

/**
 * Return the largest share of a limit that any joint uses, %.
 * @param {PlanMessage[]} plans
 * @param {"peak_velocity" | "peak_acceleration"} kind
 */
const largest = (plans, kind) => 100 * Math.max(...plans.flatMap(({ criteria }) => criteria[kind]));

/**
 * Return the nearest that a motion comes to each thing that it keeps away from, in units of the trade.
 * @param {PlanMessage[]} plans
 */
function nearest(plans) {
  /** @type {Map<string, {value: number, unit: string}>} */
  const found = new Map();
  for (const { name, value, unit } of plans.flatMap(({ criteria }) => criteria.nearest)) {
    if (value === null) continue;
    const scaled = unit === "rad" ? deg(value) : unit === "m" ? 1e3 * value : value;
    const units = { rad: "deg", m: "mm", "m^3": "m\u00b3" }[unit] ?? unit;
    const known = found.get(name);
    if (!known || scaled < known.value) found.set(name, { value: scaled, unit: units });
  }
  return found;
}

/** @param {PlanMessage[]} plans */
const gap = (plans) =>
  plans.every((plan) => plan.gap !== null)
    ? 100 * Math.max(...plans.map((plan) => /** @type {number} */ (plan.gap)))
    : null;

/** @param {PlanMessage[]} plans */
const seconds = (plans) => sum(plans.map(({ time }) => time[time.length - 1]));

/**
 * Return the criteria of two plans.
 * @param {PlanMessage[]} then
 * @param {PlanMessage[]} now
 * @param {{alike: boolean, cycle: [number | null, number | null]}} more
 * @returns {Row[]}
 */
export function rows(then, now, { alike, cycle }) {
  const [before, after] = [nearest(then), nearest(now)];
  const cost = (/** @type {PlanMessage[]} */ plans) => sum(plans.map((plan) => plan.cost));
  /** @type {Row[]} */
  const found = [
    { name: "Time of the cut", unit: "s", then: seconds(then), now: seconds(now), better: -1 },
    { name: "Cycle of the job", unit: "s", then: cycle[0], now: cycle[1], better: -1, places: 1 },
    {
      ...{ name: "Joint travel", unit: "deg", better: -1, places: 1 },
      then: deg(sum(then.flatMap(({ criteria }) => criteria.displacement))),
      now: deg(sum(now.flatMap(({ criteria }) => criteria.displacement))),
    },
    {
      ...{ name: "Top speed", unit: "% limit", better: -1, places: 1 },
      then: largest(then, "peak_velocity"),
      now: largest(now, "peak_velocity"),
    },
    {
      ...{ name: "Top acceleration", unit: "% limit", better: -1, places: 1 },
      then: largest(then, "peak_acceleration"),
      now: largest(now, "peak_acceleration"),
    },
    ...[...new Set([...before.keys(), ...after.keys()])].map((name) => ({
      ...{ name: `Nearest: ${name}`, better: /** @type {const} */ (1) },
      unit: (after.get(name) ?? before.get(name))?.unit ?? "",
      then: before.get(name)?.value ?? null,
      now: after.get(name)?.value ?? null,
    })),
    { name: "Gap to the bound", unit: "%", then: gap(then), now: gap(now), better: -1, places: 2 },
  ];
  // Costs of another metric or of other weights are numbers of another kind.
  if (alike)
    found.unshift({ name: "Cost", unit: "", then: cost(then), now: cost(now), better: -1 });
  return found.filter((row) => row.then !== null || row.now !== null);
}

/**
 * Return a criterion of two plans, joint by joint.
 * @param {PlanMessage[]} then
 * @param {PlanMessage[]} now
 * @param {OfJoint} kind
 * @returns {Row[]}
 */
export function jointRows(then, now, kind) {
  const joints = then[0].criteria.displacement.length;
  return Array.from({ length: joints }, (_, joint) => ({
    name: `J${joint + 1}`,
    unit: OF_JOINT[kind].unit,
    then: ofJoint(then, kind, joint),
    now: ofJoint(now, kind, joint),
    better: -1,
    places: 1,
  }));
}

/**
 * Return rows as the body of a table, with their differences.
 * @param {Row[]} found
 */
export const body = (found) => el("tbody", {}, ...found.map(line));

/** @param {Row} row */
function line({ name, unit, then, now, better, places }) {
  const text = (/** @type {number | null} */ value) =>
    value === null ? "\u2013" : places === undefined ? digits(value, 3) : fixed(value, places);
  const by = then === null || now === null ? null : now - then;
  const same = by === null || text(then) === text(now);
  const good = !same && better !== 0 && by * better > 0;
  const said = by === null ? "" : same ? "same" : `${by > 0 ? "+" : ""}${text(by)}`;
  return el(
    "tr",
    {},
    el("th", { scope: "row" }, name, unit ? el("small", {}, ` ${unit}`) : null),
    el("td", {}, text(then)),
    el("td", {}, text(now)),
    el(
      "td",
      { class: same ? "quiet" : good ? "down" : "up" },
      said,
      same || by === null ? null : el("span", { class: "unseen" }, good ? " better" : " worse"),
    ),
  );
}
