/** The joints of the robot: a slider for each weight, and the motion and load of each joint. */

import { send, store } from "../app.js";
import { axesOf } from "../axes.js";
import { digits, fixed, sum } from "../format.js";
import { Slider, card, colourKey, gesture, html, icon, useHeld } from "../ui.js";
import { staleClass } from "./result.js";

/** @typedef {import("../messages.js").PlanMessage} PlanMessage */
/** @typedef {import("../axes.js").Axis} Axis */

/** @type {(value: number[] | null, drag: string) => boolean} */
const setWeights = (value, drag) =>
  send({ type: "edit", path: ["plan", "weights"], value, gesture: drag });

/** The weights and the figures of all joints. */
export function jointsPanel() {
  const { valid: job, scene, chosen: plans } = store;
  const usual = job?.weights ?? [];
  const axes = axesOf(scene?.robot);
  // The weights of a changed job arrive before its scene.
  if (!scene || !usual.length || axes.length !== usual.length) return null;
  /** @type {number[] | null} */
  const given = job?.values?.plan?.weights ?? null;
  const weights = given ?? usual;
  /** @type {(joint: number, ratio: number, drag: string) => void} */
  const set = (joint, ratio, drag) => {
    const to = weights.map((each, j) => (j === joint ? ratio * usual[j] : each));
    setWeights(
      to.map((each) => Number(each.toPrecision(4))),
      drag,
    );
  };
  const reset = html`
    <button class="text" disabled=${!store.live || !given}
      title="Remove the weights from the job: each joint is then weighted by its speed limit"
      onClick=${() => setWeights(null, gesture())}>${icon("reset")}Default weights</button>`;
  const units = [...new Set(axes.map(({ unit }) => unit))].join(", ");
  const columns = [
    ["", ""],
    ["weight", "× default"],
    ["moves", units],
    ["speed", "% limit"],
    ["accel.", "% limit"],
  ];
  const named = axes.some(({ external }) => external) ? "named" : "";
  const rows = axes.map((axis, j) => {
    const weight = {
      ...{ joint: j, times: weights[j] / usual[j] },
      title: `${digits(weights[j], 3)} per ${scene.robot.joints[j].unit}`,
    };
    return html`
      <tr key=${`${j} ${axis.label}`}>
        <th scope="row" title=${axis.label}>
          <label for=${`weight-${j + 1}`}>${colourKey(axis.colour)}${axis.label}</label>
        </th>
        <td><${Weight} ...${weight} set=${set} /></td>
        <td>${plans.length > 0 && travel(plans, j, axis)}</td>
        ${share(plans.map(({ criteria }) => criteria.peak_velocity[j]))}
        ${share(plans.map(({ criteria }) => criteria.peak_acceleration[j]))}
      </tr>`;
  });
  const table = html`
    <table class=${`joints ${named} ${staleClass(plans)}`}>
      <thead>
        <tr>${columns.map(([name, unit]) => html`<th scope="col">${name}<small>${unit}</small></th>`)}</tr>
      </thead>
      <tbody>${rows}</tbody>
    </table>`;
  return card("Joints", reset, table);
}

/**
 * A slider for the weight of a joint: 0, or a tenth to ten times the default.
 * @param {{joint: number, times: number, title: string,
 *   set: (joint: number, ratio: number, drag: string) => void}} props
 */
function Weight({ joint, times, title, set }) {
  const ratio = (/** @type {number} */ at) => (at < -1.03 ? 0 : 10 ** at);
  const [at, hold] = useHeld(times < 0.09 ? -1.1 : Math.log10(times));
  const now = ratio(at);
  const shown = now.toFixed(now >= 9.95 || now === 0 ? 0 : now >= 0.995 ? 1 : 2);
  const slider = {
    ...{ id: `weight-${joint + 1}`, min: -1.1, max: 1, step: 0.05, disabled: !store.live },
    ...{ value: at, "aria-valuetext": `${shown} times the default weight`, onHold: hold },
    onSet: (/** @type {number} */ value, /** @type {string} */ drag) =>
      set(joint, ratio(value), drag),
  };
  return html`
    <div class="weight" title=${title}>
      <${Slider} ...${slider} /><output for=${slider.id}>×${shown}</output>
    </div>`;
}

/**
 * How far a joint moves, with an arrow if that is more or less than before.
 * @param {PlanMessage[]} plans
 * @param {number} joint
 * @param {Axis} axis
 */
function travel(plans, joint, axis) {
  const moved = (/** @type {PlanMessage[]} */ all) =>
    axis.of(sum(all.map(({ criteria }) => criteria.displacement[joint])));
  const [now, before] = [moved(plans), moved(store.before.get(plans[0].contour) ?? [])];
  if (!before || Math.abs(now - before) < 0.02 * before) return fixed(now, 1);
  const more = now > before;
  const words = `${more ? "more" : "less"} than before: ${fixed(before, 1)} ${axis.unit}`;
  return html`
    ${fixed(now, 1)}
    <span class=${more ? "up" : "down"} title=${words}>${more ? "\u25b4" : "\u25be"}</span>
    <span class="unseen">${words}</span>`;
}

/**
 * A cell with the largest share of a limit, as a number and as a bar.
 * @param {number[]} shares
 */
function share(shares) {
  const most = Math.max(0, ...shares);
  const width = { width: `${Math.min(100, 100 * most)}%` };
  return html`
    <td>
      <span>${shares.length ? fixed(100 * most, 0) : ""}</span>
      <span class="share"><i class=${most > 0.9 ? "high" : ""} style=${width} /></span>
    </td>`;
}
