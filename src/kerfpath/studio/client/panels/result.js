/** Times, margin and proof of the chosen contour's plan, or the reason why there is none. */

import { store } from "../app.js";
import { byId } from "../dom.js";
import { change, counted, digits, fixed, inUnits, percent, secondsOf, sum } from "../format.js";
import { card, dot, html, icon } from "../ui.js";
import { standing } from "./contours.js";
import { noPath } from "./nopath.js";

/** @typedef {import("../messages.js").PlanMessage} PlanMessage */

/**
 * The plan of the chosen contour, or why it has none.
 * @param {{look: (view: string) => void}} view
 */
export function resultPanel(view) {
  const { selected: name, chosen: plans } = store;
  const nopath = store.nopaths.get(name ?? "");
  byId("result").dataset.revision = String(plans[0]?.revision ?? nopath?.revision ?? "");
  if (!name) return null;
  const { mark, words } = standing(name);
  const candidate = store.candidate?.contour === name;
  const badge = candidate
    ? html`<span class="badge warn">a point of the Pareto set</span>`
    : html`<span class=${`badge ${mark}`}>${words}</span>`;
  if (nopath)
    return card(
      name,
      badge,
      noPath(nopath, () => view.look("mark")),
    );
  if (plans.length) return card(name, badge, figures(plans), `result ${staleClass(plans)}`);
  const why = store.progress.busy
    ? "The first plan takes a few seconds, later ones a fraction of a second."
    : "Not planned. Plan again to see its motion.";
  return card(name, badge, html`<p class="quiet">${why}</p>`);
}

/** @param {PlanMessage[]} plans */
export const staleClass = (plans) => (plans.some((plan) => store.stale(plan)) ? "stale" : "");

/** @param {PlanMessage[]} plans */
function figures(plans) {
  const [cost, before] = [plans, store.before.get(plans[0].contour) ?? []].map((all) =>
    sum(all.map((plan) => plan.cost)),
  );
  const changed = store.comparable(plans[0].contour) ? change(cost, before) : "";
  const better = changed === "same" ? "" : cost > before ? "up" : "down";
  const total = cycleTime();
  const seconds = html`${fixed(secondsOf(plans), 2)}<small> s</small>`;
  const { left, joint, limit } = margin(plans);
  return html`
    <div class="figures">
      <div>
        <span class="label">${total ? "Cycle time" : "Time of the cut"}</span>
        <b>${total ? html`${fixed(total)}<small> s</small>` : seconds}</b>
        ${total > 0 && html`<span class="label">this cut ${seconds}</span>`}
      </div>
      <div>
        <span class="label">Margin to the limits</span>
        <b id="margin" class=${left < 0 ? "fault" : ""}>${fixed(100 * left, 0)}<small> %</small></b>
        <span class="label">least: ${limit} of ${joint}</span>
      </div>
    </div>
    ${plans.flatMap(({ checks }) => checks ?? []).map(failure)}
    <details>
      <summary>Details</summary>
      <p>
        Cost <span id="cost">${digits(cost, 4)}</span>
        ${changed && html`<span class=${`delta ${better}`}>${changed}</span>`}
      </p>
      <p class="proof">${proof(plans)}</p>
    </details>`;
}

/** The time of the program in s, or 0 if it is not known for the job as it is. */
function cycleTime() {
  const { program, outcome } = store;
  const now = program && outcome?.revision === program.revision && !store.stale(program);
  return now ? program.total : 0;
}

/**
 * Return the least share that is left of a limit of speed or acceleration, and of which.
 * @param {PlanMessage[]} plans
 */
function margin(plans) {
  const names = store.scene?.robot.joints.map(({ name }) => name) ?? [];
  const peaks = plans.flatMap(({ criteria }) =>
    [
      { limit: "speed", shares: criteria.peak_velocity },
      { limit: "acceleration", shares: criteria.peak_acceleration },
    ].flatMap(({ limit, shares }) =>
      shares.map((share, j) => ({ left: 1 - share, limit, joint: names[j] ?? `joint ${j + 1}` })),
    ),
  );
  return peaks.reduce((least, each) => (each.left < least.left ? each : least));
}

/** @param {PlanMessage[]} plans */
function proof(plans) {
  const gaps = plans.map(({ gap }) => gap ?? Infinity);
  const most = Math.max(...gaps);
  if (most < Infinity)
    return html`
      ${icon("check")}Proved: the best motion, at any gamma, posture and turn, saves at most
      ${` ${percent(most, most < 0.01 ? 2 : 1)} of this cost.`}`;
  if (plans.some(({ settled }) => !settled))
    return html`${dot("busy")}The bound on the best cost is being computed.`;
  return plans.every(({ optimal }) => optimal)
    ? "Proved: the best motion on its grid."
    : "The best motion found; no bound on the best cost is proved.";
}

/** @param {import("../messages.js").CheckEntry} check */
function failure({ title, value, limit, unit, level, ok }) {
  const is = value === null ? "" : `: ${inUnits(value, unit)}`;
  const most = limit === null ? "" : `, the limit is ${inUnits(limit, unit)}`;
  return !ok && html`<p class=${classOf(level)}>${icon("warning")}${` ${title}${is}${most}`}</p>`;
}

/**
 * A plan passes with a warning.
 * @param {string} level
 */
const classOf = (level) => (level === "warning" ? "doubt" : "fault");

/** The audit of the plan of the chosen contour, and its margins. */
export function auditPanel() {
  const { chosen: plans } = store;
  if (!plans.length) return null;
  const checks = plans.flatMap((plan) => plan.checks ?? []);
  const near = plans.flatMap(({ criteria }) => criteria.nearest);
  const audit = checks.length ? `${counted(checks.length, "check")} of the audit, and margins` : "";
  return html`
    <section class="card">
      <details>
        <summary>${audit || "Margins"}</summary>
        ${table(
          near.map(({ name, value, unit }) => ({
            ...{ name: `nearest: ${name}`, level: "", ok: true },
            value: value === null ? "none" : inUnits(value, unit),
          })),
        )}
        ${table(
          checks.map(({ title: name, value, unit, level, ok }) => ({
            ...{ name, level, ok },
            value: value === null ? (ok ? "yes" : "no") : inUnits(value, unit),
          })),
        )}
        <p class="quiet">${plans[0].statement}</p>
      </details>
    </section>`;
}

/** @param {{name: string, value: string, level: string, ok: boolean}[]} rows */
const table = (rows) => html`
  <table class="figures-list">
    <tbody>
      ${rows.map(
        ({ name, value, level, ok }) =>
          html`<tr><th scope="row">${name}</th><td class=${ok ? "" : classOf(level)}>${value}</td></tr>`,
      )}
    </tbody>
  </table>`;
