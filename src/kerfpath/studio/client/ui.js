/** The building blocks of the panels: markup, and the elements that several panels share. */

import htm from "htm";
import { h, render } from "preact";
import { useLayoutEffect, useRef, useState } from "preact/hooks";

import { store } from "./app.js";
import { onNextFrame } from "./dom.js";

/** @typedef {import("preact").ComponentChildren} Content */
/** @typedef {import("preact").VNode} Markup */

/** @type {(parts: TemplateStringsArray, ...values: unknown[]) => Markup} */
export const html = /** @type {any} */ (htm.bind(h));

/** @type {[HTMLElement, () => Content][]} */
const drawn = [];

/**
 * Draw content into an element of the page, now and with each `redraw`.
 * @param {HTMLElement} host
 * @param {() => Content} content
 */
export function mount(host, content) {
  drawn.push([host, content]);
  draw(host, content());
}

/** Draw all mounted content again with the next frame. */
export const redraw = onNextFrame(() => drawn.forEach(([host, content]) => draw(host, content())));

/**
 * Draw content into an element of the page.
 * @param {HTMLElement} host
 * @param {Content} content
 */
export const draw = (host, content) => render(/** @type {any} */ (content), host);

/**
 * An icon of the page's sheet, hidden from screen readers.
 * @param {string} name
 */
export const icon = (name) =>
  html`<svg class="icon" aria-hidden="true"><use href=${`#i-${name}`} /></svg>`;

/**
 * A round mark: "done", "busy", "warn", "none" or "open".
 * @param {string} kind
 */
export const dot = (kind) => html`<i class=${`dot ${kind}`} />`;

/**
 * A square in a colour of the theme.
 * @param {string} colour
 */
export const colourKey = (colour) =>
  html`<i class="key" style=${{ background: `var(${colour})` }} />`;

/**
 * A card of a panel, with content beside its title.
 * @param {string} title
 * @param {Content} tools
 * @param {Content} body
 * @param {string} [more]  classes
 */
export const card = (title, tools, body, more = "") => html`
  <section class=${`card ${more}`}>
    <header><h2>${title}</h2><span class="grow" />${tools}</header>
    ${body}
  </section>`;

/** @type {(summary: Content, texts: string[]) => unknown} texts that fold; nothing without any */
export const folded = (summary, texts) =>
  texts.length > 0 &&
  html`<details><summary>${summary}</summary>${texts.map((each) => html`<p>${each}</p>`)}</details>`;

/** @typedef {{value: string, label: string}} Choice */
/** @typedef {{value: string, label: Content}} Pictured */

/**
 * A group of buttons, of which one is pressed.
 * @param {string} label
 * @param {Pictured[]} choices
 * @param {string} value
 * @param {(value: string) => void} choose
 * @param {boolean} [disabled]
 */
export const segments = (label, choices, value, choose, disabled = false) => html`
  <div class="segments" role="group" aria-label=${label}>
    ${choices.map(
      (each) => html`
        <button key=${each.value} aria-pressed=${String(each.value === value)} disabled=${disabled}
          onClick=${() => choose(each.value)}>${each.label}</button>`,
    )}
  </div>`;

/**
 * Options of a list; "" is a choice like any other.
 * @param {Choice[]} choices
 */
export const options = (choices) =>
  choices.map(({ value, label }) => html`<option key=${value} value=${value}>${label}</option>`);

/**
 * A text or number field; what a person is typing in it is not replaced.
 * @param {{value: string, onSet: (text: string) => void} & Record<string, unknown>} props
 */
export function Input({ value, onSet, ...rest }) {
  const input = useRef(/** @type {HTMLInputElement | null} */ (null));
  useLayoutEffect(() => {
    if (input.current && document.activeElement !== input.current) input.current.value = value;
  });
  return html`
    <input
      ref=${input}
      onChange=${() => onSet(input.current?.value ?? "")}
      onKeyDown=${blurOnEnter}
      ...${rest}
    />`;
}

/** @param {KeyboardEvent} event  of a field */
export const blurOnEnter = ({ key, target }) =>
  key === "Enter" && /** @type {HTMLElement} */ (target).blur();

/** Attributes of a field for a number. */
export const NUMBER = { class: "number", type: "number", step: "any", inputmode: "decimal" };

const EVERY = 60; // ms between the edits of one drag
let gestures = 0;

/** Return the name of a new gesture, whose edits are one step of undo. */
export const gesture = () => `${Date.now().toString(36)}-${gestures++}`;

/**
 * Return a value, or the one that a person has dragged it to until the job has answered, and a
 * function that holds it there.
 * @param {number} value
 * @returns {[number, (value: number, done: boolean) => void]}
 */
export function useHeld(value) {
  const [held, hold] = useState({ value, until: /** @type {unknown} */ ("nothing") });
  const holding = held.until === null || held.until === store.job;
  return [
    holding ? held.value : value,
    (to, done) => hold({ value: to, until: done ? store.job : null }),
  ];
}

/**
 * A slider that sends its value while it is dragged, as one gesture.
 * @param {{value: number, onHold: (value: number, done: boolean) => void,
 *   onSet: (value: number, gesture: string) => void} & Record<string, any>} props
 */
export function Slider({ value, onHold, onSet, ...rest }) {
  const slider = useRef(/** @type {HTMLInputElement | null} */ (null));
  const [drag] = useState({ name: "", timer: 0, last: 0 });
  useLayoutEffect(() => {
    if (!slider.current) return;
    slider.current.value = String(value);
    fill(slider.current);
  });
  const now = () => Number(slider.current?.value);
  const pass = () => {
    [drag.timer, drag.last] = [0, performance.now()];
    onSet(now(), drag.name);
  };
  const slide = () => {
    drag.name ||= gesture();
    drag.timer ||= window.setTimeout(pass, Math.max(0, EVERY - (performance.now() - drag.last)));
    onHold(now(), false);
  };
  const release = () => {
    clearTimeout(drag.timer);
    drag.name ||= gesture();
    pass();
    drag.name = "";
    onHold(now(), true);
  };
  return html`<input ref=${slider} type="range" onInput=${slide} onChange=${release} ...${rest} />`;
}

/**
 * Colour a slider up to its value.
 * @param {HTMLInputElement} slider
 */
export function fill(slider) {
  const { min, max, value } = slider;
  const share = (Number(value) - Number(min)) / (Number(max) - Number(min) || 1);
  slider.style.setProperty("--fill", `${100 * share}%`);
}
