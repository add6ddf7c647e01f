/** The header and footer of the page: job, undo and redo, exports, theme, progress, notices. */

import { useEffect, useRef, useState } from "preact/hooks";

import { connection, send, store } from "../app.js";
import { isDark, switchTheme } from "../desk.js";
import { dot, html, icon } from "../ui.js";
import { openLine } from "./jobtext.js";
import { openSheet } from "./sheet.js";

/** @typedef {import("../scene/record.js").Extra} Extra */

/**
 * The header of the page.
 * @param {Extra[]} extras  exports that the page makes itself
 */
export function topBar(extras) {
  const { job, scene } = store;
  const open = store.connection === "open";
  const live = open && job !== null;
  const title = job ? `${job.saved ? "" : "• "}${job.name} – kerfpath studio` : "kerfpath studio";
  if (document.title !== title) document.title = title;
  const saved = !job ? "" : job.saved ? "saved" : "not saved; kept beside the job";
  const theme = isDark() ? "Use the light theme" : "Use the dark theme";
  const savable = live && !job.saved && !job.faults.length;
  /** @type {(name: import("./sheet.js").Name, on: boolean, look: string, words: string) => unknown} */
  const opener = (name, on, look, words) => html`
    <button id=${`open-${name}`} class="plain" disabled=${!on} onClick=${() => openSheet(name)}>
      ${icon(look)}${words}
    </button>`;
  /** @type {(type: "undo" | "redo", on: boolean, words: string) => unknown} */
  const step = (type, on, words) => html`
    <button id=${type} class="tool" title=${words} aria-label=${words.split(" ")[0]}
      disabled=${!on} onClick=${() => send({ type })}>${icon(type)}</button>`;
  return html`
    <h1><img src="client/icon.svg" alt="" width="20" height="20" />kerfpath <span>studio</span></h1>
    <div id="job-name">
      <strong id="file">${job?.name ?? "Opening the job"}</strong>${" "}
      <span id="saved">${saved}</span>
    </div>
    <div class="group" role="group" aria-label="Changes">
      ${step("undo", live && job.undo, "Undo (Ctrl+Z)")}
      ${step("redo", live && job.redo, "Redo (Ctrl+Shift+Z)")}
    </div>
    <div class="grow" />
    ${opener("cell", live, "keep", "Cell")}
    ${opener("layout", open && Boolean(scene?.contours.length), "move", "Layout")}
    ${opener("text", live, "file", "Job file")}
    ${opener("program", live, "file", "Program")}
    <${ExportMenu} live=${live} extras=${extras} />
    <button id="save" class="primary" disabled=${!savable} onClick=${() => send({ type: "save" })}>
      ${icon("save")}Save job
    </button>
    <button id="theme" class="tool" aria-label=${theme} title="Light or dark" onClick=${switchTheme}>
      ${icon(isDark() ? "sun" : "moon")}
    </button>`;
}

/** @param {{live: boolean, extras: Extra[]}} props */
function ExportMenu({ live, extras }) {
  const [open, setOpen] = useState(false);
  const menu = useRef(/** @type {HTMLElement | null} */ (null));
  const entries = () => [...(menu.current?.querySelectorAll("a, .entry") ?? [])];
  /** @param {number} i */
  const focus = (i) => /** @type {HTMLElement | undefined} */ (entries().at(i))?.focus();
  useEffect(() => {
    if (!open) return undefined;
    focus(0);
    const leave = (/** @type {PointerEvent} */ { target }) => {
      if (!menu.current?.contains(/** @type {Node} */ (target))) setOpen(false);
    };
    document.addEventListener("pointerdown", leave);
    return () => document.removeEventListener("pointerdown", leave);
  }, [open]);
  /** @param {KeyboardEvent} event */
  const key = (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (event.key === "Escape") {
      setOpen(false);
      /** @type {HTMLElement | null | undefined} */ (
        menu.current?.querySelector("#export")
      )?.focus();
    } else if (step) {
      const at = entries().indexOf(/** @type {Element} */ (document.activeElement));
      focus((at + step) % entries().length);
      event.preventDefault();
    }
  };
  return html`
    <div class="menu" ref=${menu}>
      <button id="export" class="plain" aria-haspopup="true" aria-expanded=${String(open)}
        aria-controls="export-menu" disabled=${!live} onClick=${() => setOpen(!open)}>
        ${icon("export")}Export
      </button>
      <div id="export-menu" hidden=${!open} onKeyDown=${key} onClick=${() => setOpen(false)}>
        ${open && exports(extras)}
      </div>
    </div>`;
}

/** @param {Extra[]} extras */
function exports(extras) {
  const files = store.outcome?.exports ?? [];
  const none = "Files can be exported once every contour is planned.";
  return html`
    ${files.map((each) => (each.ready ? link(each) : [off(each.name, each.why), remedy(each)]))}
    ${!files.length && off("Nothing yet", none)}
    ${extras.map(({ name, about, why, make }) =>
      why()
        ? off(name, why())
        : html`<button class="entry" onClick=${make}>${name}<small>${about}</small></button>`,
    )}`;
}

/** @type {(name: string, why: string | null) => unknown} */
const off = (name, why) => html`<div class="off">${name}<small>${why}</small></div>`;

/** @param {import("../messages.js").Export} file  a button that makes it ready */
const remedy = ({ remedy: words, edits }) => {
  const take = () => send({ type: "edits", edits });
  return (
    words && html`<button class="entry remedy" onClick=${take}>${icon("check")}${words}</button>`
  );
};

/** @param {import("../messages.js").Export} file  a link to it */
function link({ name, about, href: path }) {
  const token = location.search.slice(1);
  const href = path.slice(1) + (token && (path.includes("?") ? "&" : "?") + token);
  const own = path.startsWith("/report"); // it is shown, not saved
  return html`
    <a href=${href} download=${own ? null : ""} target=${own ? "_blank" : null}>
      ${name}<small>${about}</small>
    </a>`;
}

/** The footer of the page. */
export function foot() {
  const { progress, connection: status } = store;
  const open = status === "open";
  const busy = open && progress.busy;
  const link = open ? "connected" : status === "lost" ? "not connected" : "connecting";
  const doing = busy ? progress.label || "planning" : open && store.job ? "ready" : "";
  const cancel = () => send({ type: "cancel" });
  return html`
    <span id="link">${dot(open ? "done" : "none")}${link}</span>
    <span id="doing">${doing}</span>
    ${bar("Progress", progress, { id: "bar", hidden: !busy })}
    <button id="cancel" class="text" hidden=${!busy} onClick=${cancel}>Cancel</button>
    <span class="grow" />
    <span id="hint">Space plays, arrow keys step, F fits the view, G keeps a ghost</span>`;
}

/**
 * A progress bar; it has no value as long as the total is not known.
 * @param {string} label
 * @param {{done: number, total: number}} progress
 * @param {Record<string, unknown>} more
 */
export const bar = (label, { done, total }, more) => html`
  <progress max="1" value=${total > 0 ? done / total : null} aria-label=${label} ...${more} />`;

/** Errors, and what to do about them, above the desk. */
export function notices() {
  const undo = html`
    <button class="plain" disabled=${!store.job?.undo} onClick=${() => send({ type: "undo" })}>
      ${icon("undo")}Undo
    </button>`;
  return html`
    ${store.broken && html`<${Lost} />`}
    ${(store.job?.faults ?? []).map(({ key, line, message }) => {
      const at =
        line && html`<button class="link" onClick=${() => openLine(line)}>Line ${line}</button>`;
      const words = `${key.length ? `${key.join(".")}: ` : ""}${message}`;
      return notice("bad", at ? html`${at}, ${words}` : words, undo);
    })}
    ${store.errors.map((error) => html`<${Notice} key=${error.message} error=${error} />`)}`;
}

/** @param {{error: import("../messages.js").ErrorMessage}} props */
function Notice({ error }) {
  const drop = () => store.dismiss(error);
  const force = () => {
    send({ type: "save", over: true });
    drop();
  };
  const conflict = error.about === "save" && error.message.includes("changed since");
  return notice(
    "",
    error.message,
    html`
      ${conflict && html`<button class="plain" onClick=${force}>Save over it</button>`}
      <button class="tool" aria-label="Dismiss" onClick=${drop}>${icon("close")}</button>`,
  );
}

/** The connection is lost; it counts down to the next try. */
function Lost() {
  const [, tick] = useState(0);
  useEffect(() => {
    const timer = window.setInterval(() => tick((n) => n + 1), 500);
    return () => clearInterval(timer);
  }, []);
  const seconds = Math.max(1, Math.ceil(((store.retryAt ?? 0) - Date.now()) / 1000));
  const when = store.connection === "lost" ? `Next try in ${seconds} s.` : "Trying now.";
  const what = store.met
    ? `The studio's server has stopped or cannot be reached. All changes are kept beside the job file; start "kerfpath studio" again and open the address that it prints.`
    : "The studio's server does not answer.";
  const again = html`<button class="plain" onClick=${() => connection.open()}>Try now</button>`;
  return notice("bad", `${what} ${when}`, again);
}

/** @type {(kind: "bad" | "", text: unknown, buttons: unknown) => unknown} */
const notice = (kind, text, buttons) =>
  html`<div class=${`notice ${kind}`}>${icon("warning")}<p>${text}</p>${buttons}</div>`;
