/** Two plans side by side: a kept plan, and the plan that is shown now. */

import { player, send, store } from "../app.js";
import { axesOf } from "../axes.js";
import { jointsAt } from "../kinematics.js";
import { Input, card, html, icon, segments } from "../ui.js";
import { jointRows, rows, table } from "./differences.js";

/** @import { KeptEntry, PlanMessage } from "../messages.js" */
/** @typedef {import("./differences.js").OfJoint} OfJoint */
/** @typedef {{accompany: (q: ArrayLike<number> | null) => void}} View */

/** @type {{value: OfJoint, label: string}[]} */
const OF_JOINT = [
  { value: "displacement", label: "Moves" },
  { value: "range", label: "Range" },
  { value: "peak_velocity", label: "Speed" },
  { value: "peak_acceleration", label: "Accel." },
];

const state = {
  /** @type {number | null} the one that is compared, also while its plans are being fetched */
  chosen: null,
  keeping: false,
  ghost: true,
  kind: OF_JOINT[0].value,
};

/**
 * Follow the list of kept plans, and show the robot of the compared one.
 * @param {View} view
 */
export function followKept(view) {
  const follow = () => view.accompany(companion());
  store.on(["kept"], heard);
  store.on(["error"], ({ about }) => about === "keep" && (state.keeping = false));
  store.on(["compare", "selected"], follow);
  player.on(follow);
}

/** Take the list of kept plans: compare with one just kept here, and drop one that is gone. */
function heard() {
  const entry = store.kept.find(({ id }) => id === state.chosen);
  if (state.keeping && store.kept.length) choose(store.kept[store.kept.length - 1]);
  else if (state.chosen !== null && !entry) choose(null);
  else if (entry && store.against?.entry.settled !== entry.settled) choose(entry);
  else if (entry && store.against) store.compareWith({ ...store.against, entry });
  state.keeping = false;
}

/** @param {KeptEntry | null} entry */
async function choose(entry) {
  state.chosen = entry?.id ?? null;
  if (!entry) return store.compareWith(null);
  const answer = await fetch(`kept/${entry.id}${location.search}`);
  const newest = store.kept.find(({ id }) => id === entry.id);
  if (state.chosen !== entry.id || !answer.ok || !newest) return;
  const found = /** @type {PlanMessage[]} */ (await answer.json());
  const plans = Map.groupBy(found, ({ contour }) => contour);
  for (const pieces of plans.values()) pieces.sort((a, b) => a.s[0] - b.s[0]);
  if (state.chosen === entry.id) store.compareWith({ entry: newest, plans });
}

/** Return the joints of the compared robot at the same path length, or null. */
function companion() {
  const { moment } = player;
  const plan = moment?.span.plan;
  const others = (state.ghost && plan && store.compared(plan.contour)) || [];
  if (!plan || !moment || !others.length) return null;
  const [s] = jointsAt(plan.time, plan.s, 1, moment.local);
  const other = others.find((each) => s <= each.s[each.s.length - 1]) ?? others[others.length - 1];
  return jointsAt(other.s, other.q, other.weights.length, s);
}

/**
 * The kept plans, and the comparison with one of them.
 * @param {View} view
 */
export function comparePanel(view) {
  const { against, kept } = store;
  if (!store.job) return null;
  const live = store.connection === "open";
  const keep = html`
    <button class="plain" title="Keep the current job and its plans"
      disabled=${!store.live || !store.plans.size}
      onClick=${() => (state.keeping = send({ type: "keep" }))}>${icon("keep")}Keep to compare</button>`;
  const list = html`
    <div class="kept" role="group" aria-label="Kept plans" hidden=${!kept.length}>
      ${kept.map((entry) => {
        const pressed = entry.id === state.chosen;
        return html`
          <button
            key=${entry.id}
            aria-pressed=${String(pressed)}
            title=${pressed ? "Compare with none" : `Compare with ${entry.name}`}
            onClick=${() => choose(pressed ? null : entry)}
          >${entry.name}</button>`;
      })}
      ${against && naming(against.entry, live)}
    </div>`;
  return card("Compare", keep, [
    list,
    html`<div>${against && comparison(against, live, view)}</div>`,
  ]);
}

/** @type {(entry: KeptEntry, live: boolean) => unknown} */
function naming({ id, name }, live) {
  const field = {
    ...{ class: "name", value: name, maxlength: 40, disabled: !live },
    "aria-label": "Name of the kept plan",
    onSet: (/** @type {string} */ text) =>
      text.trim() && send({ type: "rename", id, name: text.trim() }),
  };
  return html`
    <span class="grow" />
    <${Input} key=${`name of ${id}`} ...${field} />
    <button class="tool" title=${`Forget ${name}`} aria-label=${`Forget ${name}`} disabled=${!live}
      onClick=${() => send({ type: "forget", id })}>${icon("close")}</button>`;
}

/** @type {(against: import("../store.js").Against, live: boolean, view: View) => unknown} */
function comparison({ entry, plans }, live, view) {
  const { id, name } = entry;
  const [then, now] = [store.compared(store.selected ?? ""), store.chosen];
  const both = then.length > 0 && now.length > 0;
  const why = then.length
    ? `This contour has no plan now; ${name} has one.`
    : plans.has(store.selected ?? "")
      ? `The robot of ${name} has other joints or external axes.`
      : `${name} has no plan for this contour.`;
  const haunt = () => {
    state.ghost = !state.ghost;
    view.accompany(companion());
  };
  return html`
    ${both ? figures(entry, then, now) : html`<p class="quiet small">${why}</p>`}
    <div class="actions">
      <button class="plain" title="Restore this job, as one step of undo" disabled=${!live}
        onClick=${() => send({ type: "restore", id })}>Go back to ${name}</button>
      <button class="text" title="Show its robot in the scene, at the same path length" hidden=${!both}
        aria-pressed=${String(state.ghost)} onClick=${haunt}>Show its robot</button>
    </div>`;
}

/** @type {(entry: KeptEntry, then: PlanMessage[], now: PlanMessage[]) => unknown} */
function figures(entry, then, now) {
  const { name, cycle } = entry;
  const { outcome } = store;
  const alike = store.question(then[0], entry) === store.question(now[0]);
  const known = outcome && !store.stale(outcome) ? outcome.cycle : null;
  const axes = axesOf(store.scene?.robot);
  const more = { alike, axes };
  const pick = (/** @type {string} */ kind) => (state.kind = /** @type {OfJoint} */ (kind));
  const unlike = "Their costs cannot be compared: weights, metric or objective differ.";
  return html`
    <div>
      ${table(name, rows(then, now, { ...more, cycle: [cycle?.total ?? null, known?.total ?? null] }))}
      ${!alike && html`<p class="quiet small">${unlike}</p>`}
    </div>
    <details>
      <summary>Joint by joint</summary>
      ${segments("Criterion", OF_JOINT, state.kind, pick)}
      ${table(name, jointRows(then, now, state.kind, axes))}
    </details>`;
}
