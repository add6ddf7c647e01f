/** The timeline of the program: its segments, and the joints of the robot at each time. */

import { interval, jointsAt } from "./kinematics.js";

/** @import { PlanMessage, ProgramMessage } from "./messages.js" */

/**
 * @typedef {object} Span
 * @property {"move" | "approach" | "pierce" | "cut" | "retract"} kind
 * @property {number} begin
 * @property {number} end
 * @property {string | null} contour
 * @property {PlanMessage | null} plan
 * @property {ArrayLike<number>} time  from `begin` on
 * @property {ArrayLike<number>} q
 */

/**
 * @typedef {object} Moment
 * @property {number} t
 * @property {number} index  of the span
 * @property {Span} span
 * @property {number[]} q
 * @property {number} local  s from the begin of the span
 * @property {number} node  of the plan for a cut, else of the span's rows
 */

/** The spans of a program in order; `whole` is false if only the cuts are known so far. */
export class Timeline {
  /**
   * @param {Span[]} spans
   * @param {number} joints
   * @param {boolean} whole
   */
  constructor(spans, joints, whole) {
    this.spans = spans;
    this.joints = joints;
    this.whole = whole;
    this.total = spans.length ? spans[spans.length - 1].end : 0;
  }

  /**
   * Return the robot at a time.
   * @param {number} t  s
   * @returns {Moment | null}
   */
  at(t) {
    if (!this.spans.length) return null;
    const clamped = Math.min(Math.max(t, 0), this.total);
    const index = Math.max(
      0,
      this.spans.findLastIndex(({ begin }) => begin <= clamped),
    );
    const span = this.spans[index];
    const local = Math.min(clamped - span.begin, span.end - span.begin);
    const q = jointsAt(span.time, span.q, this.joints, local);
    const near = span.time.length > 1 ? interval(span.time, local) : 0;
    const next = Math.min(near + 1, span.time.length - 1);
    const node = local - span.time[near] > span.time[next] - local ? next : near;
    return { t: clamped, index, span, q, local, node };
  }

  /**
   * Return when a node of a contour's plan is cut, or null.
   * @param {PlanMessage} plan
   * @param {number} node
   */
  when(plan, node) {
    const span = this.spans.find((each) => each.plan?.name === plan.name);
    return span ? span.begin + plan.time[node] : null;
  }

  /**
   * Return when a contour's first cut begins, or null.
   * @param {string} contour
   */
  begin(contour) {
    return (
      this.spans.find((span) => span.contour === contour && span.kind === "cut")?.begin ?? null
    );
  }
}

/**
 * Return the timeline of a program, or of the cuts one after the other without a program.
 * @param {ProgramMessage | null} program
 * @param {Map<string, PlanMessage[]>} plans
 * @param {string[]} order  the contours
 * @param {number} joints
 * @returns {Timeline}
 */
export function timelineOf(program, plans, order, joints) {
  const known = new Map([...plans.values()].flat().map((plan) => [plan.name, plan]));
  const segments = program?.segments ?? [];
  /** @type {Span[]} */
  const spans = [];
  for (const segment of segments) {
    const plan = (segment.plan && known.get(segment.plan)) || null;
    if (segment.plan && !plan) return new Timeline(cuts(plans, order), joints, false);
    spans.push({
      kind: segment.kind,
      begin: segment.begin,
      end: segment.end,
      contour: segment.contour,
      plan,
      time: plan?.time ?? segment.time ?? [0],
      q: plan?.q ?? segment.q ?? [],
    });
  }
  if (spans.length) return new Timeline(spans, joints, true);
  return new Timeline(cuts(plans, order), joints, false);
}

/**
 * Return the cuts alone, one after the other.
 * @param {Map<string, PlanMessage[]>} plans
 * @param {string[]} order
 * @returns {Span[]}
 */
function cuts(plans, order) {
  /** @type {Span[]} */
  const spans = [];
  let begin = 0;
  for (const plan of order.flatMap((name) => plans.get(name) ?? [])) {
    const end = begin + plan.time[plan.time.length - 1];
    const { contour, time, q } = plan;
    spans.push({ kind: "cut", begin, end, contour, plan, time, q });
    begin = end;
  }
  return spans;
}
