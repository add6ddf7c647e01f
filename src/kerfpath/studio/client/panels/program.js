/** The text of the program beside the scene; its lines are linked to places of the motion. */

import { useEffect, useRef } from "preact/hooks";

import { player, send, store } from "../app.js";
import { html, options, redraw, segments } from "../ui.js";
import { sheetShown } from "./sheet.js";

/** @typedef {import("../messages.js").ProgramTextMessage} Answer */

const SOON = "It is written once every contour has a plan that passes its audit.";
const LINKED =
  "Click a line, or use the arrow keys, to move the robot there; the current line is marked.";
const UNLINKED =
  "Programs in this language are not read back, so their lines are not linked to the scene.";

const state = {
  language: "",
  asked: 0, // the revision
  waiting: false,
  why: "", // there is no program
  file: 0, // the shown one
  line: 0, // the marked one, from 1; 0: none
};

const shown = () => sheetShown() === "program";

/** Follow the answers of the server, the results of the job and the player. */
export function followProgram() {
  store.on(["program_text"], ({ language, files }) => {
    Object.assign(state, { language, waiting: false, why: "" });
    state.file = Math.min(state.file, Math.max(0, files.length - 1));
    follow();
  });
  store.on(["error"], ({ about, message }) => {
    if (about === "program") Object.assign(state, { waiting: false, why: message });
  });
  store.on(["outcome"], ({ revision }) => {
    if (!shown() || revision === state.asked) return;
    state.asked = revision;
    request(); // what is shown follows the job
  });
  player.on(follow);
}

/** @type {import("./sheet.js").Sheet} */
export const programSheet = {
  docked: true,
  opened: () => ask(state.language || (store.job?.values?.program?.language ?? "")),
  content: () => {
    const files = (!state.waiting && !state.why && store.program_text?.files) || [];
    const tabs = files.map(({ name }, i) => ({ value: String(i), label: name }));
    const pick = (/** @type {string} */ i) => show(Number(i));
    return {
      title: files.length === 1 ? files[0].name : "Program",
      tools: html`
        ${tabs.length > 1 && segments("File", tabs, String(state.file), pick)}${languages()}`,
      body,
    };
  },
};

function request() {
  send({ type: "program", ...(state.language ? { language: state.language } : {}) });
}

/** @param {string} language */
function ask(language) {
  Object.assign(state, { language, asked: store.outcome?.revision ?? 0, waiting: true, why: "" });
  request();
}

function languages() {
  const words = store.options?.languages ?? [];
  if (!words.length) return null;
  const choices = words.map((word) => ({ value: word, label: word }));
  return html`
    <select aria-label="Language" value=${state.language}
      onChange=${(/** @type {any} */ { target }) => ask(target.value)}>${options(choices)}</select>`;
}

function body() {
  const answer = store.program_text;
  if (state.waiting)
    return html`<div class="state still"><div class="spinner" /><p>Writing the program</p></div>`;
  if (state.why || !answer) return none(state.why);
  const linked = answer.files.some(({ lines }) => lines.length) && player.timeline.whole;
  const file = answer.files[state.file];
  return html`
    ${notes(answer)}
    ${!file && none(SOON)}
    ${file && html`<${Listing} text=${file.text} />`}
    ${file && html`<footer><span class="quiet">${linked ? LINKED : UNLINKED}</span></footer>`}`;
}

/** @param {string} why */
const none = (why) => html`<div class="state still"><strong>No program</strong><p>${why}</p></div>`;

/** @param {Answer} answer */
function notes({ faults, findings, notes: more }) {
  const items = [
    ...faults.map((each) => html`<li class="fault">${each}</li>`),
    ...findings.map(finding),
    ...more.map((each) => html`<li>${each}</li>`),
  ];
  return items.length > 0 && html`<ul class="notes">${items}</ul>`;
}

/** @param {Answer["findings"][number]} finding */
function finding({ level, message, place, file, line }) {
  const bad = level === "error" ? "fault" : null;
  if (file === null || line === null) return html`<li class=${bad}>${place}: ${message}</li>`;
  const jump = () => {
    const i = store.program_text?.files.findIndex(({ name }) => name === file) ?? -1;
    if (i < 0) return;
    show(i);
    go(line);
    mark(line);
  };
  return html`
    <li class=${bad}>
      <button class="link" onClick=${jump}>${file}, line ${line}</button> (${place}): ${message}
    </li>`;
}

/**
 * The text of a file with numbered lines; a click or the arrow keys choose another one.
 * @param {{text: string}} props
 */
function Listing({ text }) {
  const listing = useRef(/** @type {HTMLElement | null} */ (null));
  const code = useRef(/** @type {HTMLElement | null} */ (null));
  const here = useRef(/** @type {HTMLElement | null} */ (null));
  const lines = text.replace(/\n$/, "").split("\n");
  const height = () => (code.current?.getBoundingClientRect().height ?? 0) / lines.length;
  const { line } = state;
  useEffect(() => listing.current?.scrollTo(0, 0), [text]);
  useEffect(() => {
    const [bar, pane] = [here.current, listing.current];
    if (!line || !bar || !pane) return;
    const top = (line - 1) * height();
    bar.style.height = `${height()}px`;
    bar.style.transform = `translateY(${top}px)`;
    if (top < pane.scrollTop || top + height() > pane.scrollTop + pane.clientHeight)
      pane.scrollTop = top - pane.clientHeight / 2;
  }, [text, line]);
  /** @param {PointerEvent} event */
  const click = ({ clientY }) => {
    if (getSelection()?.type === "Range" || !code.current) return; // a text is being copied
    const at = Math.floor((clientY - code.current.getBoundingClientRect().top) / height()) + 1;
    if (at >= 1 && at <= lines.length) go(at);
  };
  /** @param {KeyboardEvent} event */
  const key = (event) => {
    const way = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!way) return;
    step(way);
    event.preventDefault();
    event.stopPropagation();
  };
  return html`
    <div ref=${listing} class="listing" tabindex="0" role="region" aria-label="Text of the program"
      onClick=${click} onKeyDown=${key}>
      <div class="pane">
        <i ref=${here} class="here" hidden=${!line} />
        <pre class="gutter" aria-hidden="true">${lines.map((_, i) => i + 1).join("\n")}</pre>
        <pre ref=${code} class="code">${lines.join("\n")}</pre>
      </div>
    </div>`;
}

/** @param {number} line */
function mark(line) {
  if (state.line === line) return;
  state.line = line;
  redraw();
}

/** @param {number} file  that is shown */
function show(file) {
  if (state.file !== file) Object.assign(state, { file, line: 0 });
  redraw();
}

/**
 * Go to the place of a line, or of the next line that is linked.
 * @param {number} line
 */
function go(line) {
  const file = store.program_text?.files[state.file];
  const k = file?.lines.findIndex((each) => each >= line) ?? -1;
  if (!file || k < 0 || !player.timeline.whole) return;
  player.pause();
  player.seek(file.end[k]);
  mark(file.lines[k]); // several lines may end at that time
}

/**
 * Go to the next or the previous linked line.
 * @param {number} way  1 or -1
 */
function step(way) {
  const lines = store.program_text?.files[state.file]?.lines ?? [];
  const { line } = state;
  const next = way > 0 ? lines.find((each) => each > line) : lines.findLast((each) => each < line);
  if (next !== undefined) go(next);
}

/** Mark the line that runs now. */
function follow() {
  const files = store.program_text?.files ?? [];
  if (!shown() || !player.timeline.whole) return;
  const t = player.moment?.t ?? 0;
  const near = 1e-5; // s: times are sent to a microsecond
  // The line that ends next; the robot may also be before the first one.
  let [at, line, soonest] = [-1, 0, Infinity];
  files.forEach(({ lines, end }, i) => {
    const k = end.findIndex((each) => each >= t - near);
    if (k >= 0 && end[k] < soonest) [at, line, soonest] = [i, lines[k], end[k]];
  });
  if (at < 0) return;
  if (at !== state.file) show(at);
  mark(line);
}
