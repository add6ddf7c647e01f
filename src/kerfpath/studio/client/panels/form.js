/** The form of all options: a control for each key of the job that the server lists, and a search. */

import { useState } from "preact/hooks";

import { player, store } from "../app.js";
import { axesOf } from "../axes.js";
import { faultOf, isGiven, setKeys, valueOf } from "../job.js";
import { Input, NUMBER, card, html, icon, options } from "../ui.js";

/** @import { OptionField, Sampling } from "../messages.js" */

let wanted = ""; // the words of the search

/**
 * Whether the search finds an option.
 * @param {...string} words
 */
const found = (...words) =>
  wanted.split(/\s+/).every((word) => words.join(" ").toLowerCase().includes(word));

/** The form of all options. */
export function formPanel() {
  const { options: form } = store;
  if (!form) return null;
  const find = (/** @type {any} */ { target }) => (wanted = target.value.trim().toLowerCase());
  const field = { type: "search", class: "find", placeholder: "Find an option", onInput: find };
  const search = html`<input ...${field} aria-label="Find an option" />`;
  let any = false;
  const groups = form.groups.map(({ title, contour, fields }) => {
    const rows = fields.map((each) => ({
      shown: found(title, each.label, each.key, each.help),
      given: isGiven(each.key),
      content: html`<${Row} key=${each.key} field=${each} />`,
    }));
    if (title === "The cut") rows.unshift(samplingRow(title, form.samplings));
    const [shown, set] = [rows.some((row) => row.shown), rows.filter((row) => row.given).length];
    any ||= shown;
    return html`
      <details key=${title} class="group-of-keys" hidden=${!shown} open=${wanted !== "" && shown}>
        <summary>
          ${title}${contour && html`<small> this contour</small>`}
          <span class="quiet">${set > 0 && ` ${set} set`}</span>
        </summary>
        ${rows.map((row) => html`<div hidden=${!row.shown}>${row.content}</div>`)}
      </details>`;
  });
  const none = html`<p class="quiet small" hidden=${any}>No option matches.</p>`;
  return card("All options", search, [groups, none]);
}

/**
 * Set a key, and what goes with it; null removes it from the job.
 * @param {OptionField} field
 * @param {unknown} value
 */
function set({ key, table, companion }, value) {
  if (value === null && table) return setKeys([table, null]);
  if (!companion) return setKeys([key, value]);
  const { key: other, value: usual } = companion;
  if (value === null) return setKeys([key, null], [other, null]);
  if (valueOf(other) === null && usual !== null) return setKeys([key, value], [other, usual]);
  return setKeys([key, value]);
}

/** @param {{field: OptionField, ways?: unknown}} props  ways: a choice beside the label */
function Row({ field, ways }) {
  const { key, label, unit, help, needs, required } = field;
  const id = `key-${key.replaceAll(".", "-")}`;
  const disabled = !store.live || (needs !== null && !valueOf(needs));
  const fault = faultOf(key);
  // What was typed is wrong until the job has another answer.
  const [refused, refuse] = useState(/** @type {unknown} */ (null));
  const invalid = Boolean(fault) || (refused !== null && refused === store.job);
  const common = {
    id,
    disabled,
    "aria-invalid": String(invalid),
    "aria-describedby": `${id}-fault`,
  };
  const control = CONTROLS[field.kind](field, common, () => refuse(store.job));
  // A key that is not in the job has nothing to reset.
  const reset = { visibility: isGiven(key) && !disabled && !required ? "visible" : "hidden" };
  const name = html`<label for=${id}>${label}</label>`;
  return html`
    <div class="option" title=${help || null}>
      ${ways ? html`<span>${name} ${ways}</span>` : name}
      <span class="value">
        ${control}
        <span class="unit">${unit}</span>
        <button class="tool reset" title="Reset to default" style=${reset}
          aria-label=${`${label}: reset to default`} onClick=${() => set(field, null)}>
          ${icon("reset")}
        </button>
      </span>
      <p class="unseen" id=${`${id}-fault`} hidden=${!fault}>${fault}</p>
    </div>`;
}

/** @typedef {(field: OptionField, common: Record<string, any>, refuse: () => void) => unknown} Control */

/** @type {Record<OptionField["kind"], Control>} the control of each kind of key */
const CONTROLS = { number, choice, switch: onOff, table: presence, list, joints };

/** @type {Control} */
function number(field, common) {
  const take = (/** @type {string} */ text) => {
    if (text !== "") set(field, Number(text));
    else if (isGiven(field.key) && !field.required) set(field, null);
  };
  const value = String(valueOf(field.key) ?? "");
  return html`<${Input} ...${NUMBER} ...${common} min=${field.low} max=${field.high} placeholder="none" value=${value} onSet=${take} />`;
}

/** @type {Control} */
function choice(field, common) {
  const now = valueOf(field.key);
  const other = field.choices.includes(now) ? [] : [now ?? ""];
  const choose = (/** @type {any} */ { target }) => set(field, target.value || null);
  return html`
    <select ...${common} value=${now ?? ""} onChange=${choose}>
      ${options([...other, ...field.choices].map((word) => ({ value: word, label: word })))}
    </select>`;
}

/** @type {Control} */
function onOff(field, common) {
  const now = valueOf(field.key);
  const choose = (/** @type {any} */ { target }) => set(field, target.checked);
  return html`
    <input type="checkbox" ...${common} checked=${now === true} indeterminate=${now === null}
      title=${now === null ? "as the method requires" : ""} onChange=${choose} />`;
}

/** @type {Control} */
function presence({ key }, common) {
  const choose = (/** @type {any} */ { target }) => setKeys([key, target.checked ? {} : null]);
  return html`
    <input type="checkbox" ...${common} checked=${valueOf(key) !== null} onChange=${choose} />`;
}

/** @type {Control} */
function list(field, common, refuse) {
  const take = (/** @type {string} */ text) => {
    const parts = text.split(/[\s,;]+/).filter(Boolean);
    const values = parts.map(Number);
    if (values.length && values.every(Number.isFinite)) set(field, values);
    else if (!values.length && isGiven(field.key)) set(field, null);
    else refuse();
  };
  const value = (valueOf(field.key) ?? []).join(", ");
  return html`
    <${Input} class="wide" ...${common} placeholder="none" value=${value} onSet=${take} />`;
}

/** @type {Control} */
function joints(field, common, refuse) {
  const take = () => {
    const { moment } = player;
    if (!moment) return;
    const axes = axesOf(store.scene?.robot);
    const at = axes.map(({ of }, j) => Number(of(moment.q[j]).toFixed(2)));
    const arm = axes.filter(({ external }) => !external).length;
    const others = axes.slice(arm).map(({ unit }, i) => {
      const key = `robot.external.${i}.home_${unit}`;
      return /** @type {[string, unknown]} */ ([key, at[arm + i]]);
    });
    setKeys([field.key, at.slice(0, arm)], ...others);
  };
  return html`
    <span class="value">
      ${list(field, common, refuse)}
      <button class="tool" title="Take the shown pose" aria-label="Take the shown pose"
        disabled=${common.disabled} onClick=${take}>${icon("follow")}</button>
    </span>`;
}

/**
 * The sampling of the contour, which has one of several keys.
 * @param {string} title
 * @param {Sampling[]} samplings
 */
function samplingRow(title, samplings) {
  const now = samplings.find(({ keys }) => valueOf(keys[0]) !== null) ?? samplings[0];
  const choose = (/** @type {any} */ { target }) => {
    const to = samplings.find(({ keys }) => keys[0] === target.value) ?? now;
    const others = samplings.flatMap(({ keys }) => keys).filter((key) => !to.keys.includes(key));
    const removed = others
      .filter(isGiven)
      .map((key) => /** @type {[string, unknown]} */ ([key, null]));
    setKeys(...removed, [to.keys[0], to.usual]);
  };
  const choices = samplings.map(({ keys, label }) => ({ value: keys[0], label }));
  const ways = html`
    <select aria-label="Nodes by" value=${now.keys[0]} disabled=${!store.live} onChange=${choose}>
      ${options(choices)}
    </select>`;
  const words = samplings.flatMap(({ label, keys }) => [label, ...keys]);
  return {
    shown: found(title, "nodes by sampling", ...words),
    given: false,
    content: html`<${Row} key="sampling" field=${now.field} ways=${ways} />`,
  };
}
