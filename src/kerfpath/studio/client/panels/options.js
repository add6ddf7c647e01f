/** The main options: speed of the contour, objective, metric, posture, shares of the limits. */

import { useRef } from "preact/hooks";

import { send, store } from "../app.js";
import { capital, fixed } from "../format.js";
import { faultOf, setKey, valueOf } from "../job.js";
import { posturePicture } from "../posture.js";
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

/** @typedef {import("../messages.js").OptionField} OptionField */

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
  const disabled = off();
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
    store.options && main(store.options.groups[0]),
  ];
}

/** Whether nothing can be changed. */
const off = () => !store.live || !store.selected;

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
  const button = html`
    <button class="plain" onClick=${take}>Cut at ${fixed(best ?? 0, 2)} m/min</button>`;
  return html`
    <p>${found}<span class="quiet">${binds && `Binding limit: ${binds}`}</span></p>
    ${edits.length > 0 && button}`;
}

/**
 * The main options of the job: choices first, then shares of the limits.
 * @param {import("../messages.js").OptionGroup} group
 */
const main = ({ title, fields }) => html`
  <section class="card">
    <h2>${title}</h2>
    ${fields.filter(({ kind }) => kind === "choice").map(choice)}
    ${fields.filter(({ kind }) => kind === "number").map(share)}
  </section>`;

/** @param {OptionField} field  a list if it may be left open, else buttons */
function choice({ key, label, choices, default: usual }) {
  const now = valueOf(key) ?? "";
  const words = now && !choices.includes(now) ? [now, ...choices] : choices;
  const set = (/** @type {string} */ value) =>
    value !== now && setKey(key, value || null, gesture());
  const named = words.map((value) => ({ value, label: usual === null ? value : capital(value) }));
  const list = () => html`
    <select aria-label=${label} value=${now} disabled=${off()}
      onChange=${(/** @type {any} */ { target }) => set(target.value)}>
      ${options([{ value: "", label: "any" }, ...named])}
    </select>`;
  return html`
    <div class="field row">
      <span class="label">${label}${posturePicture(now)}</span>
      ${usual === null ? list() : segments(label, named, now, set, off())}
    </div>`;
}

/** @param {OptionField} field */
function share({ key, label }) {
  const field = {
    ...{ id: key.replace("plan.", ""), label, unit: "%", least: 30, most: 100, step: 1, places: 0 },
    ...{ value: 100 * (valueOf(key) ?? 1), disabled: off(), fault: faultOf(key) },
    onSet: (/** @type {number} */ value, /** @type {string} */ drag) =>
      setKey(key, Number((value / 100).toFixed(4)), drag),
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
      <p class="unseen" id=${`${id}-fault`} hidden=${!fault}>${fault}</p>
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
