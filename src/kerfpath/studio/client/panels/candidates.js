/** The search for the best placement: its ranges, the placements found, and taking one. */

import { send, store } from "../app.js";
import { change, counted, digits, fixed } from "../format.js";
import { NUMBER, dot, html, options } from "../ui.js";
import { bar } from "./bar.js";

/** @typedef {import("../messages.js").TryEntry} Try */
/** @typedef {import("../messages.js").Variable} Variable */
/** @typedef {import("../messages.js").LayoutMessage} Layout */

const JUDGED = [
  { value: "grid", label: "Judged on the grid (faster)" },
  { value: "plans", label: "Judged by plans over continuous gamma" },
];
const LOST = { unreachable: "out of reach", collision: "collides", speed: "no path", feasible: "" };

const variables = () => store.options?.variables ?? [];

/**
 * The search for the best placement.
 * @param {import("../scene/placing.js").Placing} placing
 * @param {() => void} moved  called once another placement is shown
 */
export function candidates(placing, moved) {
  /** @type {number | null} the one that is shown */
  let shown = null;
  let filled = false;
  /** What is searched for, as it is in the fields; a variable without a range is not varied. */
  const wanted = {
    goal: /** @type {import("../messages.js").LayoutRequest["goal"]} */ ("speed"),
    judged: "grid",
    evaluations: "64",
    /** @type {Set<string>} */
    varied: new Set(),
    /** @type {Record<string, string[]>} */
    ranges: {},
  };
  return { card, forget: () => (shown = null) };

  function running() {
    return store.layout?.state === "running" && !store.stale(store.layout);
  }

  /** The requested ranges; null if there is none, or one is invalid. */
  function ranges() {
    const names = variables().flatMap(({ key }) => (wanted.varied.has(key) ? [key] : []));
    const rising = names.every((name) => {
      const [low, high] = wanted.ranges[name];
      return low && high && Number(low) < Number(high);
    });
    if (!names.length || !rising) return null;
    const numbers = names.map((name) => [name, wanted.ranges[name].map(Number)]);
    return /** @type {Record<string, [number, number]>} */ (Object.fromEntries(numbers));
  }

  function look() {
    if (running()) return void send({ type: "cancel" });
    const spans = ranges();
    if (!spans) return;
    back();
    const count = Math.min(100000, Math.max(8, Math.round(Number(wanted.evaluations)) || 64));
    const [goal, grid] = [wanted.goal, wanted.judged === "grid"];
    send({ type: "layout", goal, ranges: spans, evaluations: count, grid });
  }

  /** Take the settings of [layout] from the job, once. */
  function fill() {
    const table = store.job?.values?.layout;
    if (filled || !table || !store.options) return;
    filled = true;
    wanted.goal = table.goal;
    if (store.job?.given.includes("layout.evaluations")) wanted.evaluations = table.evaluations;
    const given = variables().filter(({ key }) => table[key]);
    const varied = given.length ? given : variables().filter(({ varies }) => varies);
    wanted.varied = new Set(varied.map(({ key }) => key));
    for (const { key, usual } of variables())
      wanted.ranges[key] = (table[key] ?? usual).map(String);
  }

  /** @param {Try} tried */
  function show(tried) {
    shown = tried.number;
    placing.preview(tried);
    moved();
  }

  function back() {
    shown = null;
    placing.reset();
    moved();
  }

  function card() {
    fill();
    const { layout, job } = store;
    const planned = store.outcome?.revision === job?.revision;
    const stale = layout !== null && store.stale(layout);
    if (stale || !placing.moved) shown = null;
    const tries = layout?.best ?? [];
    const chosen = tries.find(({ number }) => number === shown);
    const off = !store.live || (!running() && (!planned || !ranges()));
    const words = running() ? "Stop" : layout ? "Search again" : "Search";
    const continuous = job?.values?.plan?.method === "continuous";
    const goals = Object.entries(store.options?.goals ?? {});
    /** @type {(key: "goal" | "judged" | "evaluations") => (event: any) => void} */
    const set = (key) => (event) => (wanted[key] = event.target.value);
    const count = { ...NUMBER, min: 8, max: 100000, step: 8, value: wanted.evaluations };
    return html`
      <section class="card">
        <header>
          <h3>Best placement</h3>
          <span class="grow" />
          <button class="plain" disabled=${off} onClick=${look}>${words}</button>
        </header>
        <p class="field">
          <select aria-label="Goal" value=${wanted.goal} onChange=${set("goal")}>
            ${options(goals.map(([value, label]) => ({ value, label })))}
          </select>
        </p>
        <p class="field">
          <select aria-label="Judged by" hidden=${!continuous} value=${wanted.judged}
            onChange=${set("judged")}>${options(JUDGED)}</select>
        </p>
        <details class="group-of-keys">
          <summary>Variables and ranges</summary>
          ${filled && variables().map(variable)}
          <p class="field head">
            <span>Placements to try </span>
            <input ...${count} aria-label="Placements to try" onInput=${set("evaluations")} />
          </p>
        </details>
        ${bar("Progress of the search", layout ?? { done: 0, total: 0 }, { hidden: !running() })}
        <p class="quiet small" aria-live="polite">${statement(stale)}</p>
        <div class=${`list tries ${stale ? "stale-set" : ""}`}>
          ${tries.map((each) => entry(each, stale || !store.live))}
        </div>
        <div class="actions">${chosen && taking(chosen)}</div>
      </section>`;
  }

  /** @param {Variable} each */
  function variable({ key, label, unit }) {
    const end = (/** @type {0 | 1} */ i) => {
      const set = (/** @type {any} */ { target }) => (wanted.ranges[key][i] = target.value);
      const words = `${label}, ${["least", "most"][i]}, ${unit}`;
      const value = wanted.ranges[key][i];
      return html`<input ...${NUMBER} value=${value} aria-label=${words} onInput=${set} />`;
    };
    const toggle = () => wanted.varied.delete(key) || wanted.varied.add(key);
    return html`
      <div class="vary" key=${key}>
        <label>
          <input type="checkbox" checked=${wanted.varied.has(key)} onChange=${toggle} /> ${label}
        </label>
        ${end(0)}${end(1)}
        <span class="unit">${unit}</span>
      </div>`;
  }

  /** @param {boolean} stale */
  function statement(stale) {
    const { layout } = store;
    if (!layout)
      return "Searches for the best placement around the current one. It takes from seconds to many minutes; a change of the job stops it.";
    if (stale) return "Out of date: the job has changed. Search again for the current job.";
    const tried = `${counted(layout.tried, "placement")} tried`;
    const at = layout.total ? `${layout.done} of ${layout.total}` : "under way";
    if (running()) return `${layout.label}: ${at}. ${tried}.`;
    const stopped = layout.state === "stopped" ? "; stopped" : "";
    const grid = " Values are for the grid; plans over continuous gamma may be faster.";
    return `${tried}, ${layout.feasible} feasible${stopped}. ${layout.said}${layout.grid ? grid : ""}`;
  }

  /** @type {(tried: Try, disabled: boolean) => unknown} */
  function entry(tried, disabled) {
    const { number, offsets, value, status, reason } = tried;
    const mark = status !== "feasible" ? "none" : value !== null ? "done" : "";
    return html`
      <button key=${number} data-number=${number} aria-current=${String(number === shown)} disabled=${disabled}
        title=${reason} onClick=${() => show(tried)}>
        ${dot(mark)}
        <span class="name">${worth(tried)}</span>
        <span class="more">${isOwn(tried) ? "placement of the job" : moves(offsets)}</span>
      </button>`;
  }

  /** @param {Try} tried */
  function taking({ number, status, reason }) {
    const take = () => placing.sent(send({ type: "take", number }));
    const off = !store.live || status !== "feasible";
    return html`
      <button class="primary" disabled=${off} onClick=${take}>Take it</button>
      <button class="plain" onClick=${back}>Back to the job's place</button>
      ${reason && html`<p class="fault">${reason}</p>`}`;
  }
}

/**
 * Return what is known of the value of a placement.
 * @param {Try} tried
 */
function worth(tried) {
  const { value, bound, estimate, status } = tried;
  const { goal, unit, best } = /** @type {Layout} */ (store.layout);
  if (value !== null) {
    const own = isOwn(tried) ? null : (best.find(isOwn)?.value ?? null);
    return `${digits(value, 3)} ${unit}${own === null ? "" : `, ${change(value, own)}`}`;
  }
  if (status !== "feasible") return LOST[status];
  const most = goal === "motion" ? "at least" : "at most";
  if (bound !== null) return `${most} ${digits(bound, 3)} ${unit}`;
  return estimate === null ? "within reach" : `about ${digits(estimate, 3)} ${unit}`;
}

/** @param {Try} tried */
const isOwn = ({ offsets }) => Object.values(offsets).every((each) => each === 0);

/** @param {Record<string, number>} offsets */
const moves = (offsets) =>
  variables()
    .filter(({ key }) => offsets[key])
    .map(({ key, label, unit }) => {
      const value = offsets[key];
      return `${label} ${value > 0 ? "+" : ""}${fixed(value, 1)} ${unit}`;
    })
    .join(", ");
