/** The figures of two plans of a contour, by criterion and by joint. */

import { digits, fixed, secondsOf, shownUnit, sum } from "../format.js";
import { html } from "../ui.js";

/** @typedef {import("../messages.js").PlanMessage} PlanMessage */
/** @typedef {import("../axes.js").Axis} Axis */
/** @typedef {"displacement" | "range" | "peak_velocity" | "peak_acceleration"} OfJoint */

/**
 * @typedef {object} Row
 * @property {string} name
 * @property {string} unit
 * @property {number | null} then  of the plan that is compared
 * @property {number | null} now
 * @property {1 | -1} [better]  1: more is better; default: less is better
 * @property {number} [places]  default: three significant digits
 */

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
 * Return the least value of each measure of comfort along a motion, in the shown units.
 * @param {PlanMessage[]} plans
 */
function nearest(plans) {
  /** @type {Map<string, {value: number, unit: string}>} */
  const found = new Map();
  for (const { name, value, unit } of plans.flatMap(({ criteria }) => criteria.nearest)) {
    if (value === null) continue;
    const shown = shownUnit(unit);
    const known = found.get(name)?.value ?? Infinity;
    if (shown.of(value) < known) found.set(name, { value: shown.of(value), unit: shown.unit });
  }
  return found;
}

/**
 * Return the criteria of two plans.
 * @param {PlanMessage[]} then
 * @param {PlanMessage[]} now
 * @param {{alike: boolean, cycle: [number | null, number | null], axes: Axis[]}} more
 *   alike: whether their costs can be compared
 * @returns {Row[]}
 */
export function rows(then, now, { alike, cycle, axes }) {
  /** @type {(name: string, unit: string, of: (plans: PlanMessage[]) => number | null, places?: number) => Row} */
  const row = (name, unit, of, places) => ({ name, unit, then: of(then), now: of(now), places });
  /** @type {(kind: "peak_velocity" | "peak_acceleration") => (plans: PlanMessage[]) => number} */
  const largest = (kind) => (plans) =>
    100 * Math.max(...plans.flatMap(({ criteria }) => criteria[kind]));
  /** @type {(chosen: Axis[]) => (plans: PlanMessage[]) => number} */
  const travel = (chosen) => (plans) =>
    sum(chosen.map((axis) => ofJoint(plans, "displacement", axes.indexOf(axis), axis)));
  const [arm, others] = [false, true].map((is) => axes.filter(({ external }) => external === is));
  const gap = (/** @type {PlanMessage[]} */ plans) =>
    100 * Math.max(...plans.map((plan) => plan.gap ?? Infinity));
  const known = (/** @type {number} */ value) => (value < Infinity ? value : null);
  const [before, after] = [nearest(then), nearest(now)];
  const measures = [...new Map([...before, ...after])];
  const found = [
    ...(alike ? [row("Cost", "", (plans) => sum(plans.map(({ cost }) => cost)))] : []),
    row("Time of the cut", "s", secondsOf),
    { name: "Cycle of the job", unit: "s", then: cycle[0], now: cycle[1], places: 1 },
    row("Joint travel", "deg", travel(arm), 1),
    ...others.map((axis) => row(`Travel of ${axis.label}`, axis.unit, travel([axis]), 1)),
    row("Top speed", "% limit", largest("peak_velocity"), 1),
    row("Top acceleration", "% limit", largest("peak_acceleration"), 1),
    ...measures.map(([name, { unit }]) => ({
      ...{ name: `Nearest: ${name}`, unit, better: /** @type {const} */ (1) },
      then: before.get(name)?.value ?? null,
      now: after.get(name)?.value ?? null,
    })),
    row("Gap to the bound", "%", (plans) => known(gap(plans)), 2),
  ];
  return found.filter((each) => each.then !== null || each.now !== null);
}

/**
 * Return a criterion of two plans, joint by joint.
 * @param {PlanMessage[]} then
 * @param {PlanMessage[]} now
 * @param {OfJoint} kind
 * @param {Axis[]} axes
 * @returns {Row[]}
 */
export const jointRows = (then, now, kind, axes) =>
  axes.map((axis, joint) => ({
    name: axis.label,
    unit: kind === "displacement" || kind === "range" ? axis.unit : "% limit",
    then: ofJoint(then, kind, joint, axis),
    now: ofJoint(now, kind, joint, axis),
    places: 1,
  }));

/**
 * Rows as a table, with their differences.
 * @param {string} name  of the plan that is compared
 * @param {Row[]} found
 */
export const table = (name, found) => html`
  <table class="compared">
    <thead>
      <tr><td />${[name, "now", "difference"].map((each) => html`<th scope="col">${each}</th>`)}</tr>
    </thead>
    <tbody>${found.map(line)}</tbody>
  </table>`;

/** @param {Row} row */
function line({ name, unit, then, now, better = -1, places }) {
  const text = (/** @type {number | null} */ value) =>
    value === null ? "\u2013" : places === undefined ? digits(value, 3) : fixed(value, places);
  const by = then === null || now === null ? null : now - then;
  const same = by === null || text(then) === text(now);
  const good = !same && by * better > 0;
  const words = by === null ? "" : same ? "same" : `${by > 0 ? "+" : ""}${text(by)}`;
  return html`
    <tr>
      <th scope="row">${name}${unit && html`<small> ${unit}</small>`}</th>
      <td>${text(then)}</td>
      <td>${text(now)}</td>
      <td class=${same ? "quiet" : good ? "down" : "up"}>
        ${words}${!same && html`<span class="unseen">${good ? " better" : " worse"}</span>`}
      </td>
    </tr>`;
}
