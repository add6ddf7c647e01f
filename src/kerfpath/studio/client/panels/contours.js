/** The list of contours with the state of their plans; one of them is chosen. */

import { store } from "../app.js";
import { clock, fixed, millimetres, secondsOf } from "../format.js";
import { dot, folded, html, icon } from "../ui.js";
import { switchContour, switchedOff } from "../job.js";
import { openSheet } from "./sheet.js";

/** @typedef {import("../messages.js").ContourEntry} ContourShape */
/** The state of a contour: its mark, and words. */
/** @typedef {{mark: "done" | "none" | "warn" | "busy" | "open", words: string}} Standing */

/**
 * Return the state of a contour.
 * @param {string} name
 * @returns {Standing}
 */
export function standing(name) {
  const { busy } = store.progress;
  const [nopath, plans] = [store.nopaths.get(name), store.plans.get(name)];
  if (nopath && !store.stale(nopath)) return { mark: "none", words: "no path" };
  if (!plans || plans.some((plan) => store.stale(plan)))
    return busy
      ? { mark: "busy", words: plans ? "planning again" : "planning" }
      : { mark: "open", words: plans ? "out of date" : "not planned" };
  if (plans.some(({ passed }) => passed === false))
    return { mark: "warn", words: "fails its audit" };
  if (plans.every(({ passed }) => passed)) return { mark: "done", words: "audited" };
  return busy ? { mark: "busy", words: "being refined" } : { mark: "done", words: "planned" };
}

/** The contours of the job, and the cycle time of its program. */
export function contoursPanel() {
  const { scene } = store;
  const loops = store.connection === "open" && store.part;
  const none = scene ? "The job has no contour. Add one under Job file." : "Reading the drawing …";
  return html`
    <header>
      <h2>Contours</h2>
      <span class="grow" />
      <button id="open-loops" class="text" title="The loops of the part, cut or not"
        disabled=${!loops} onClick=${() => openSheet("loops")}>Loops …</button>
    </header>
    <div id="contours" class="list">
      ${scene?.contours.length ? scene.contours.map(row) : html`<p class="empty">${none}</p>`}
      ${switchedOff().map(offRow)}
    </div>
    <div id="cycle">${cycle()}</div>`;
}

/** @param {ContourShape} contour */
function row({ name, s }) {
  const { mark, words } = standing(name);
  const seconds = secondsOf(store.plans.get(name) ?? []);
  return html`
    <div class="switched" key=${name}>
    ${onOff(name, true)}
    <button
      aria-current=${String(name === store.selected)}
      title=${`${name}: ${millimetres(s[s.length - 1], 0)}, ${words}`}
      onClick=${() => store.select(name)}
    >
      ${dot(mark)}
      <span class="name">${name}</span>
      <span class="time">${seconds ? `${fixed(seconds, 1)} s` : ""}</span>
      ${(mark === "none" || mark === "warn") && html`<span class="more">${words}</span>`}
    </button>
    </div>`;
}

/** @param {string} name  of a contour that is switched off */
const offRow = (name) => html`
  <div class="switched off" key=${name}>
    ${onOff(name, false)}<span class="name">${name}</span><span class="quiet">not cut</span>
  </div>`;

/**
 * The box that switches a contour on or off; the last one stays on.
 * @param {string} name
 * @param {boolean} on
 */
function onOff(name, on) {
  const last = on && store.scene?.contours.length === 1;
  const title = last ? "The only contour that is cut" : on ? "Do not cut it" : "Cut it";
  const change = (/** @type {any} */ { target }) => switchContour(name, target.checked);
  return html`
    <input type="checkbox" aria-label=${`Cut ${name}`} title=${title} checked=${on}
      disabled=${!store.live || last} onChange=${change} />`;
}

/** The cycle time and the notes of the program. */
function cycle() {
  const { program, outcome } = store;
  const notes = [...new Set([...(program?.notes ?? []), ...(outcome?.notes ?? [])])];
  const times = program && outcome?.revision === program.revision ? outcome.cycle : null;
  const total = times?.total ?? program?.total ?? 0;
  const title = notes.length > 1 ? `${notes.length} notes on the program` : "A note on the program";
  return html`
    ${total > 0 && html`<div class="total"><span>Cycle time</span><b>${duration(total)}</b></div>`}
    ${total > 0 && times && shares(times)}
    ${folded(html`${icon("warning")}${title}`, notes)}`;
}

/** @param {number} seconds */
const duration = (seconds) => (seconds < 60 ? `${fixed(seconds)} s` : `${clock(seconds)} min`);

/** @param {{cutting: number, air: number, piercing: number}} times */
function shares({ cutting, air, piercing }) {
  /** @type {(seconds: number, colour: string) => unknown} */
  const part = (seconds, colour) =>
    seconds > 0 && html`<i style=${{ flexGrow: seconds, background: `var(${colour})` }} />`;
  const [c, a, p] = [cutting, air, piercing].map((each) => fixed(each));
  return html`
    <div class="shares" aria-hidden="true">
      ${part(cutting, "--cut")}${part(air, "--moving")}${part(piercing, "--pierce")}
    </div>
    <p class="quiet">${`Cutting ${c} s, transfer ${a} s, piercing ${p} s`}</p>`;
}
