/** The Pareto set of the chosen contour: its points, whose motions can be shown and taken. */

import { useEffect, useRef } from "preact/hooks";

import { send, store } from "../app.js";
import { digits, shownUnit } from "../format.js";
import { SCALE_GRADIENT } from "../scene/scale.js";
import { Scatter } from "../scatter.js";
import { card, html, options, redraw } from "../ui.js";
import { bar } from "./bar.js";

/** @typedef {import("../messages.js").FrontMessage} FrontMessage */

const MOST = 5; // criteria of one set
const STALE = "Out of date: the job has changed. Search again for the current job.";
const NO_KEYS =
  "This plan was restricted by windows of joints or by a clearance, for which a job has no keys. kerfpath pareto --pick writes its program.";
const TAKING = "Taking it sets weights, limits, metric, objective and method for every contour.";

const scatter = new Scatter();
const wanted = new Set(["displacement", "velocity", "range"]);
let runs = 100;

/** Return the set of the chosen contour, or null. */
const mine = () => (store.front?.contour === store.selected ? store.front : null);

const running = () => store.front?.state === "running" && !store.stale(store.front);

function search() {
  if (running()) return send({ type: "cancel" });
  const { selected: contour } = store;
  store.withdraw();
  return contour && send({ type: "front", contour, criteria: [...wanted], runs });
}

/** @param {number} number  of the point whose motion is shown */
function show(number) {
  const front = mine();
  if (front && !store.stale(front)) send({ type: "point", contour: front.contour, number });
}

/**
 * Return a criterion in the units that are shown.
 * @param {FrontMessage["axes"][number]} axis
 */
function shownAxis({ name, words, unit, better }) {
  const known = shownUnit(unit);
  const label = `${words}, ${known.unit} ${better === "less" ? "\u2193" : "\u2191"}`;
  return { ...known, name, words, label };
}

/** The Pareto set, and the search for it. */
export function frontPanel() {
  if (!store.job) return null;
  const front = mine();
  const off = !store.live || !store.chosen.length || wanted.size < 2;
  const words = running() ? "Stop" : front ? "Search again" : "Search";
  const start = html`<button class="plain" disabled=${off} onClick=${search}>${words}</button>`;
  const progress = store.front ?? { done: 0, total: 1 };
  const count = {
    ...{ class: "number", type: "number", min: 10, max: 1000, step: 10, value: runs },
    onInput: (/** @type {any} */ { target }) => (runs = clamped(target.value)),
    "aria-label": "Runs of the planner",
  };
  return card(
    "Pareto set",
    start,
    html`
      ${bar("Progress of the Pareto set", progress, { hidden: !running() })}
      <div hidden=${!front} class=${front && store.stale(front) ? "stale-set" : ""}>
        ${front && set(front)}
      </div>
      <div class="actions">${front && taking(front)}</div>
      <details class="group-of-keys">
        <summary>Criteria and runs</summary>
        <div class="criteria" role="group" aria-label="Criteria">
          ${(store.options?.criteria ?? []).map(criterion)}
        </div>
        <p class="field head"><label>Runs of the planner </label><input ...${count} /></p>
      </details>`,
  );
}

/** @param {string} text */
const clamped = (text) => Math.min(1000, Math.max(10, Math.round(Number(text)) || 100));

/** @param {string} word */
function criterion(word) {
  const toggle = () => wanted.delete(word) || wanted.add(word);
  const on = wanted.has(word);
  const off = !on && wanted.size >= MOST;
  return html`
    <label key=${word}>
      <input type="checkbox" checked=${on} disabled=${off} onChange=${toggle} /> ${word}
    </label>`;
}

/** @param {FrontMessage} front */
function set(front) {
  const axes = front.axes.map(shownAxis);
  scatter.load(
    front,
    axes,
    store.candidate?.contour === front.contour ? store.candidate.number : null,
  );
  const by = scatter.shown[2];
  const [low, high] = by < 0 ? [] : scatter.spans[by].map((value) => digits(value, 3));
  const names = axes.map(({ name }, i) => ({ value: String(i), label: name }));
  const pickers = ["across", "up", "by colour"].map(
    (name, i) => html`
      <select
        aria-label=${`Criterion ${name}`}
        value=${String(scatter.shown[i])}
        onChange=${(/** @type {any} */ { target }) => (scatter.shown[i] = Number(target.value))}
      >${options(i === 2 ? [{ value: "-1", label: "one colour" }, ...names] : names)}</select>`,
  );
  return html`
    <div class="pickers">${pickers}</div>
    <div class="scatter-box"><${Points} front=${front} /></div>
    <p class="quiet small" hidden=${by < 0 || !front.points.length}>
      <span>${low} </span>
      <i class="ramp" style=${{ background: SCALE_GRADIENT }} />
      <span> ${high} ${axes[by]?.unit}</span>
    </p>
    <p class="quiet small" aria-live="polite">${statement(front, axes)}</p>`;
}

/**
 * The canvas of the points, which the pointer and keys choose among.
 * @param {{front: FrontMessage}} props
 */
function Points({ front }) {
  const host = useRef(/** @type {HTMLCanvasElement | null} */ (null));
  useEffect(() => {
    scatter.canvas = host.current;
    const sized = new ResizeObserver(() => scatter.draw());
    if (host.current) sized.observe(host.current);
    return () => sized.disconnect();
  }, []);
  useEffect(() => scatter.draw());
  const hover = (/** @type {number | null} */ number) => {
    if (number === scatter.hover) return;
    scatter.hover = number;
    redraw();
  };
  /** @param {KeyboardEvent} event */
  const key = (event) => {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const best = scatter.points.filter((point) => point.best);
    best.sort((a, b) => a.values[scatter.shown[0]] - b.values[scatter.shown[0]]);
    if (event.key === "Enter" && scatter.hover !== null) show(scatter.hover);
    if (!by || !best.length) return;
    const at = best.findIndex(({ number }) => number === (scatter.hover ?? scatter.chosen));
    hover(best[Math.min(Math.max(at + by, 0), best.length - 1)].number);
    event.preventDefault();
    event.stopPropagation();
  };
  const at = (/** @type {PointerEvent} */ event) =>
    scatter.at(event.offsetX, event.offsetY)?.number ?? null;
  const click = (/** @type {PointerEvent} */ event) => {
    const number = at(event);
    if (number !== null) show(number);
  };
  const best = front.points.filter((point) => point.best).length;
  const label = `${best} non-dominated plans; arrow keys go from one to the next, Enter shows its motion`;
  return html`
    <canvas ref=${host} class="scatter" tabindex="0" aria-label=${label} onKeyDown=${key}
      style=${{ cursor: scatter.hover === null ? "" : "pointer" }} onClick=${click}
      onPointerMove=${(/** @type {PointerEvent} */ event) => hover(at(event))}
      onPointerLeave=${() => hover(null)} />`;
}

/**
 * Return the values of the point under the pointer, or the state of the search.
 * @param {FrontMessage} front
 * @param {ReturnType<typeof shownAxis>[]} axes
 */
function statement(front, axes) {
  const number = scatter.hover ?? scatter.chosen;
  const point = scatter.points.find((each) => each.number === number);
  if (point)
    return axes
      .map(({ words, unit }, i) => `${words} ${digits(point.values[i], 3)} ${unit}`)
      .join(", ");
  if (store.stale(front)) return STALE;
  if (front.state !== "running" && !front.points.length)
    return `No point to draw: none of ${front.done} runs found a plan. Without one, the result says what would help.`;
  const best = `${front.points.filter((each) => each.best).length} non-dominated plans`;
  if (front.state === "running") return `${front.done} of ${front.total} runs, ${best}.`;
  const stopped = front.state === "stopped" ? "; stopped" : "";
  return `${best}, from ${front.done} runs${stopped}. Click a plan to see its motion. The arrow of a criterion points in the better direction.`;
}

/** @param {FrontMessage} front */
function taking(front) {
  const { candidate } = store;
  const point = front.points.find(({ number }) => number === candidate?.number);
  if (!point || candidate?.contour !== front.contour) return null;
  const { edits } = point;
  const take = () => edits && send({ type: "edits", edits });
  return html`
    ${edits && html`<button class="primary" disabled=${!store.live} onClick=${take}>Take it</button>`}
    <button class="plain" onClick=${() => store.withdraw()}>Back to the job's plan</button>
    <p class="quiet small">${edits ? TAKING : NO_KEYS}</p>`;
}
