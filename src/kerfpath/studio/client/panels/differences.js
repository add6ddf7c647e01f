/** The figures of two plans of a contour, by criterion and by joint. */

import { el } from "../dom.js";
import { deg, digits, fixed } from "../format.js";

/** @typedef {import("../messages.js").PlanMessage} PlanMessage */
/** @typedef {import("../axes.js").Axis} Axis */
/** @typedef {import("../messages.js").KeptEntry} KeptEntry */
/** @typedef {"displacement" | "range" | "peak_velocity" | "peak_acceleration"} OfJoint */

/**
 * @typedef {object} Row
 * @property {string} name
 * @property {string} unit
 * @property {number | null} then  of the plan that is compared
 * @property {number | null} now
 * @property {1 | -1 | 0} better  1: more is better, -1: less is better
 * @property {number} [places]  default: three significant digits
 */

/** @type {Record<OfJoint, string>} */
export const OF_JOINT = {
  displacement: "Moves",
  range: "Range",
  peak_velocity: "Speed",
  peak_acceleration: "Accel.",
};

const sum = (/** @type {number[]} */ values) => values.reduce((total, each) => total + each, 0);

/**
 * Return a criterion of a joint over all pieces of a contour, in its unit or % of its limit.
 * @param {PlanMessage[]} plans
 * @param {OfJoint} kind
 * @param {number} joint
 * @param {Axis} axis
 */
function ofJoint(plans, kind, joint, { of }) {
  const values = plans.map(({ criteria }) => criteria[kind][joint]);
  if (kind === "displacement") return of(sum(values));
  return kind === "range" ? of(Math.max(...values)) : 100 * Math.max(...values);
}

/**
 * Return how far the joints of the arm move, and each external axis.
 * @param {PlanMessage[]} then
 * @param {PlanMessage[]} now
 * @param {Axis[]} axes
 * @returns {Row[]}
 */
function travel(then, now, axes) {
  const moved = (/** @type {PlanMessage[]} */ plans) =>
    axes.map((axis, joint) => ofJoint(plans, "displacement", joint, axis));
  const [before, after] = [moved(then), moved(now)];
  const arm = axes.filter(({ external }) => !external).length;
  /** @type {(name: string, unit: string, from: number, to: number) => Row} */
  const row = (name, unit, from, to) => ({
    ...{ name, unit, better: -1, places: 1 },
    then: sum(before.slice(from, to)),
    now: sum(after.slice(from, to)),
  });
  return [
    row("Joint travel", "deg", 0, arm),
    ...axes
      .slice(arm)
      .map(({ label, unit }, i) => row(`Travel of ${label}`, unit, arm + i, arm + i + 1)),
  ];
}

/**
 * Return the largest share of a limit that any joint uses, %.
 * @param {PlanMessage[]} plans
 * @param {"peak_velocity" | "peak_acceleration"} kind
 */
const largest = (plans, kind) => 100 * Math.max(...plans.flatMap(({ criteria }) => criteria[kind]));

/**
 * Return the least value of each measure of comfort along a motion, in the shown units.
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
 * @param {{alike: boolean, cycle: [number | null, number | null], axes: Axis[]}} more
 * @returns {Row[]}
 */
export function rows(then, now, { alike, cycle, axes }) {
  const [before, after] = [nearest(then), nearest(now)];
  const cost = (/** @type {PlanMessage[]} */ plans) => sum(plans.map((plan) => plan.cost));
  /** @type {Row[]} */
  const found = [
    { name: "Time of the cut", unit: "s", then: seconds(then), now: seconds(now), better: -1 },
    { name: "Cycle of the job", unit: "s", then: cycle[0], now: cycle[1], better: -1, places: 1 },
    ...travel(then, now, axes),
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
  // Costs with different metrics or weights cannot be compared.
  if (alike)
    found.unshift({ name: "Cost", unit: "", then: cost(then), now: cost(now), better: -1 });
  return found.filter((row) => row.then !== null || row.now !== null);
}

/**
 * Return a criterion of two plans, joint by joint.
 * @param {PlanMessage[]} then
 * @param {PlanMessage[]} now
 * @param {OfJoint} kind
 * @param {Axis[]} axes
 * @returns {Row[]}
 */
export function jointRows(then, now, kind, axes) {
  return axes.map((axis, joint) => ({
    name: axis.label,
    unit: kind === "displacement" || kind === "range" ? axis.unit : "% limit",
    then: ofJoint(then, kind, joint, axis),
    now: ofJoint(now, kind, joint, axis),
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
