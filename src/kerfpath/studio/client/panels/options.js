/** The main options: speed of the contour, objective, metric, posture, shares of the limits. */

import { useRef } from "preact/hooks";

import { send, store } from "../app.js";
import { fixed } from "../format.js";
import { faultOf, setKey, valueOf } from "../job.js";
import {
  Input,
  NUMBER,
  Slider,
  card,
  dot,
  gesture,
  html,
  icon,
  options,
  segments,
  useHeld,
} from "../ui.js";

/** @type {Record<string, string>} */
const WORDS = {
  sum: "Sum",
  max: "Largest",
  euclid: "Euclid",
  manhattan: "Manhattan",
  chebychev: "Chebychev",
};
const SPEED = "contour.speed_m_min";

/** What is known of the fastest speed of the chosen contour. */
const fastest = {
  looking: false,
  /** @type {import("../messages.js").FastestMessage | null} */
  answer: null,
};

/** Follow the search for the fastest speed; its answer is for one contour and one job. */
export function followFastest() {
  store.on(["fastest"], (answer) => Object.assign(fastest, { looking: false, answer }));
  store.on(["error"], () => (fastest.looking = false));
  store.on(["selected", "job"], () => (fastest.answer = null));
}

/** Speed, objective and limits. */
export function optionsPanel() {
  const { job, selected, table } = store;
  if (!job) return null;
  const disabled = !store.live || !selected;
  const shape = store.scene?.contours.find(({ name }) => name === selected);
  const alike = job.contours.filter(({ index }) => index === table).length;
  const speed = {
    ...{ id: "speed", label: "Cutting speed", unit: "m/min", least: 0.1, step: 0.05, places: 2 },
    ...{ value: valueOf(SPEED) ?? shape?.speed_m_min ?? 1, disabled, fault: faultOf(SPEED) },
    onSet: (/** @type {number} */ value, /** @type {string} */ drag) => setKey(SPEED, value, drag),
  };
  const find = () => (fastest.looking = send({ type: "fastest", contour: selected ?? "" }));
  const start = html`
    <button class="plain" disabled=${disabled || fastest.looking} onClick=${find}>
      ${icon("speed")}Find the fastest
    </button>`;
  const shared = `Applies to all ${alike} contours that this table of the job picks.`;
  return [
    card(
      "Speed",
      start,
      html`
        <${Amount} key=${selected} ...${speed} />
        ${alike > 1 && html`<p class="quiet small">${shared}</p>`}
        <div class="answer" aria-live="polite">${answer()}</div>`,
    ),
    html`
      <section class="card">
        <h2>Objective and limits</h2>
        ${words("objective", "Objective", disabled)}
        ${words("metric", "Metric", disabled)}
        ${posture(disabled)}
        ${share("eta_velocity", "Speed limits used", disabled)}
        ${share("eta_acceleration", "Acceleration limits used", disabled)}
      </section>`,
  ];
}

/** What was found of the fastest speed. */
function answer() {
  if (fastest.looking)
    return html`<p class="waiting">${dot("busy")}Searching for the fastest constant speed.</p>`;
  if (fastest.answer?.contour !== store.selected || !fastest.answer) return null;
  const { speed_m_min: best, binds, edits } = fastest.answer;
  const take = () =>
    edits.forEach(({ path, value }) => send({ type: "edit", path, value, gesture: "fastest" }));
  const found =
    best === null ? "No feasible speed was found. " : `Fastest: ${fixed(best, 2)} m/min. `;
  return html`
    <p>${found}<span class="quiet">${binds && `Binding limit: ${binds}`}</span></p>
    ${
      edits.length > 0 &&
      html`<button class="plain" onClick=${take}>Cut at ${fixed(best ?? 0, 2)} m/min</button>`
    }`;
}

/** @param {string} key */
const choicesOf = (key) =>
  store.options?.groups.flatMap(({ fields }) => fields).find((each) => each.key === key)?.choices ??
  [];

/** @type {(name: string, label: string, disabled: boolean) => unknown} */
function words(name, label, disabled) {
  const key = `plan.${name}`;
  const now = valueOf(key) ?? "";
  const choices = choicesOf(key).map((value) => ({ value, label: WORDS[value] ?? value }));
  const choose = (/** @type {string} */ value) => value !== now && setKey(key, value, gesture());
  return html`
    <div class="field row">
      <span class="label">${label}</span>
      ${segments(label, choices, now, choose, disabled)}
    </div>`;
}

/** @param {boolean} disabled */
function posture(disabled) {
  const now = valueOf("plan.posture") ?? "";
  const known = choicesOf("plan.posture");
  const all = now && !known.includes(now) ? [now, ...known] : known;
  const choose = (/** @type {any} */ { target }) =>
    setKey("plan.posture", target.value || null, gesture());
  const choices = all.map((word) => ({ value: word, label: word }));
  return html`
    <div class="field row">
      <label for="posture">Posture</label>
      <select id="posture" value=${now} disabled=${disabled} onChange=${choose}>
        ${options([{ value: "", label: "any" }, ...choices])}
      </select>
    </div>`;
}

/** @type {(name: string, label: string, disabled: boolean) => unknown} */
function share(name, label, disabled) {
  const key = `plan.${name}`;
  const set = (/** @type {number} */ value, /** @type {string} */ drag) =>
    setKey(key, Number((value / 100).toFixed(4)), drag);
  const field = {
    ...{ id: name, label, unit: "%", least: 30, most: 100, step: 1, places: 0 },
    ...{ value: 100 * (valueOf(key) ?? 1), disabled, fault: faultOf(key), onSet: set },
  };
  return html`<${Amount} ...${field} />`;
}

/**
 * A slider with its number; without `most` the range of the slider follows the value.
 * @param {{id: string, label: string, unit: string, least: number, most?: number, step: number,
 *   places: number, value: number, disabled: boolean, fault: string,
 *   onSet: (value: number, gesture: string) => void}} props
 */
function Amount({ id, label, unit, least, most, step, places, value, disabled, fault, onSet }) {
  const [now, hold] = useHeld(value);
  const reach = useRef(0);
  if (now === value && (value > reach.current || value < reach.current / 5))
    reach.current = nice(2 * value);
  const take = (/** @type {string} */ text) => {
    if (text !== "" && Number.isFinite(Number(text))) onSet(Number(text), gesture());
  };
  const range = { min: least, max: most ?? reach.current, step };
  const text =
    now === value ? String(Number(value.toFixed(Math.max(places, 3)))) : now.toFixed(places);
  return html`
    <div class="field">
      <div class="head">
        <label for=${id}>${label}</label>
        <span class="value">
          <${Input} ...${NUMBER} id=${`${id}-number`} min=${least} value=${text} disabled=${disabled}
            aria-label=${`${label}, ${unit}`} aria-invalid=${String(Boolean(fault))} onSet=${take} />
          <span class="unit">${unit}</span>
        </span>
      </div>
      <${Slider} id=${id} ...${range} value=${now} disabled=${disabled}
        aria-describedby=${`${id}-fault`} onHold=${hold} onSet=${onSet} />
      <p class="fault" id=${`${id}-fault`} hidden=${!fault}>${fault}</p>
    </div>`;
}

/**
 * Return a round number not below a value.
 * @param {number} value
 */
function nice(value) {
  const unit = 10 ** Math.floor(Math.log10(value));
  return unit * ([1, 1.5, 2, 3, 5, 8, 10].find((each) => each * unit >= value - 1e-9) ?? 10);
}
