/** Controls of the job: sliders with numbers, and choices; sliders send edits during a drag. */

import { el } from "../dom.js";

/** @typedef {import("../messages.js").Path} Path */
/** @typedef {(path: Path, value: unknown, gesture: string) => void} SendEdit */

const EVERY = 60; // ms between the edits of one drag
let gestures = 0;

/** Return the name of a new gesture. */
export const gesture = () => `${Date.now().toString(36)}-${gestures++}`;

/**
 * Return functions that limit how often `act` is called; `end` passes the last value at once.
 * @template T
 * @param {(value: T) => void} act
 */
function paced(act) {
  let timer = 0;
  let last = 0;
  /** @type {T} */
  let newest;
  const run = () => {
    timer = 0;
    last = performance.now();
    act(newest);
  };
  return {
    /** @param {T} value */
    call(value) {
      newest = value;
      if (!timer) timer = window.setTimeout(run, Math.max(0, EVERY - (performance.now() - last)));
    },
    /** @param {T} value */
    end(value) {
      clearTimeout(timer);
      newest = value;
      run();
    },
  };
}

/**
 * @param {HTMLInputElement} slider
 */
export function fill(slider) {
  const { min, max, value } = slider;
  const share = (Number(value) - Number(min)) / (Number(max) - Number(min) || 1);
  slider.style.setProperty("--fill", `${100 * share}%`);
}

/**
 * @typedef {object} Amount
 * @property {HTMLElement} element
 * @property {(value: number, at: {max?: number, disabled?: boolean, fault?: string}) => void} show
 */

/**
 * Return a slider with its number.
 * @param {object} what
 * @param {string} what.id
 * @param {string} what.label
 * @param {string} what.unit
 * @param {number} what.min
 * @param {number} what.max
 * @param {number} what.step
 * @param {number} what.places
 * @param {(value: number, gesture: string) => void} what.send
 * @returns {Amount}
 */
export function amount({ id, label, unit, min, max, step, places, send }) {
  const slider = el("input", {
    type: "range",
    id,
    min,
    max,
    step,
    "aria-describedby": `${id}-fault`,
  });
  const number = el("input", {
    class: "number",
    type: "number",
    id: `${id}-number`,
    min,
    step: "any",
    "aria-label": `${label}, ${unit}`,
    inputmode: "decimal",
  });
  const fault = el("p", { class: "fault", id: `${id}-fault`, hidden: true });
  const element = el(
    "div",
    { class: "field" },
    el(
      "div",
      { class: "head" },
      el("label", { for: id }, label),
      el("span", { class: "value" }, number, el("span", { class: "unit" }, unit)),
    ),
    slider,
    fault,
  );
  let held = false;
  let drag = "";
  const pace = paced((/** @type {number} */ value) => send(value, drag));
  slider.addEventListener("input", () => {
    if (!held) drag = gesture();
    held = true;
    number.value = Number(slider.value).toFixed(places);
    fill(slider);
    pace.call(Number(slider.value));
  });
  slider.addEventListener("change", () => {
    pace.end(Number(slider.value));
    held = false;
  });
  number.addEventListener("change", () => {
    if (number.value !== "" && Number.isFinite(Number(number.value)))
      send(Number(number.value), gesture());
  });
  number.addEventListener("keydown", (event) => {
    if (event.key === "Enter") number.blur();
  });
  return {
    element,
    show(value, { max: most, disabled = false, fault: wrong = "" }) {
      slider.disabled = number.disabled = disabled;
      fault.textContent = wrong;
      fault.hidden = !wrong;
      number.setAttribute("aria-invalid", String(Boolean(wrong)));
      if (held) return;
      if (most !== undefined) slider.max = String(most);
      slider.value = String(value);
      if (document.activeElement !== number)
        number.value = String(Number(value.toFixed(Math.max(places, 3))));
      fill(slider);
    },
  };
}

/**
 * Return buttons for a choice of one of a few words.
 * @param {string} label
 * @param {(value: string) => void} send
 */
export function choice(label, send) {
  const group = el("div", { class: "segments", role: "group", "aria-label": label });
  const element = el("div", { class: "field row" }, el("span", { class: "label" }, label), group);
  return {
    element,
    /**
     * @param {string} value
     * @param {{value: string, label: string}[]} choices
     * @param {boolean} disabled
     */
    show(value, choices, disabled) {
      const focused = group.contains(document.activeElement)
        ? document.activeElement?.getAttribute("data-value")
        : null;
      group.replaceChildren(
        ...choices.map((each) =>
          el(
            "button",
            {
              "data-value": each.value,
              "aria-pressed": String(each.value === value),
              disabled,
              onclick: () => each.value !== value && send(each.value),
            },
            each.label,
          ),
        ),
      );
      if (focused)
        /** @type {HTMLElement | null} */ (
          group.querySelector(`[data-value="${focused}"]`)
        )?.focus();
    },
  };
}

/**
 * Return a slider for the weight of a joint: 0, or a tenth to ten times the default.
 * @param {number} joint  0-based
 * @param {(ratio: number, gesture: string) => void} send
 */
export function weight(joint, send) {
  const id = `weight-${joint + 1}`;
  const slider = el("input", { type: "range", id, min: -1.1, max: 1, step: 0.05 });
  const shown = el("output", { for: id });
  const element = el("div", { class: "weight" }, slider, shown);
  let held = false;
  let drag = "";
  const ratio = () => (Number(slider.value) < -1.03 ? 0 : 10 ** Number(slider.value));
  const write = () => {
    const times = ratio();
    shown.textContent = `×${times.toFixed(times >= 9.95 || times === 0 ? 0 : times >= 0.995 ? 1 : 2)}`;
    slider.setAttribute("aria-valuetext", `${shown.textContent.slice(1)} times the default weight`);
    fill(slider);
  };
  const pace = paced((/** @type {number} */ value) => send(value, drag));
  slider.addEventListener("input", () => {
    if (!held) drag = gesture();
    held = true;
    write();
    pace.call(ratio());
  });
  slider.addEventListener("change", () => {
    pace.end(ratio());
    held = false;
  });
  return {
    id,
    element,
    /**
     * @param {number} times  the default weight
     * @param {string} absolute  the weight itself
     * @param {boolean} disabled
     */
    show(times, absolute, disabled) {
      slider.disabled = disabled;
      element.title = absolute;
      if (held) return;
      slider.value = String(times < 0.09 ? -1.1 : Math.log10(times));
      write();
    },
  };
}
