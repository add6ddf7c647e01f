/** The sheet of the page: over the page, or docked beside the scene, which stays usable. */

import { Fragment } from "preact";

import { store } from "../app.js";
import { byId } from "../dom.js";
import { draw, html, icon } from "../ui.js";

/** @typedef {"cell" | "text" | "program" | "loops" | "layout"} Name */

/**
 * What a sheet shows.
 * @typedef {object} Content
 * @property {string} title
 * @property {unknown} [tools]  beside the title
 * @property {() => unknown} body
 */

/**
 * One of the sheets.
 * @typedef {object} Sheet
 * @property {boolean} docked  beside the scene, not over it
 * @property {() => Content} content
 * @property {() => void} [opened]
 * @property {() => void} [closed]
 */

/** @type {Name | null} */
let shown = null;
let opening = 0; // what a sheet shows begins anew each time it is opened
/** @type {Record<Name, Sheet>} */
let sheets;

/** What the sheet shows, or null. */
export const sheetShown = () => shown;

/**
 * Prepare the sheets of the page.
 * @param {Record<Name, Sheet>} all
 */
export function prepareSheets(all) {
  sheets = all;
  const sheet = byId("sheet", HTMLDialogElement);
  const docked = () => sheet.classList.contains("docked");
  sheet.addEventListener("close", () => {
    if (!sheet.open) closed();
  });
  sheet.addEventListener("click", ({ target }) => {
    if (target === sheet && !docked()) sheet.close();
  });
  document.addEventListener("keydown", ({ key }) => {
    if (key === "Escape" && sheet.open && docked()) sheet.close();
  });
}

function closed() {
  const was = shown;
  shown = null;
  if (was) sheets[was].closed?.();
  store.emit("sheet");
}

/**
 * Open a sheet, in place of the one that is open.
 * @param {Name} name
 */
export function openSheet(name) {
  const sheet = byId("sheet", HTMLDialogElement);
  const { docked, opened } = sheets[name];
  if (shown && shown !== name) closed();
  if (sheet.open && sheet.classList.contains("docked") !== docked) sheet.close();
  shown = name;
  opening++;
  sheet.dataset.shows = name;
  sheet.classList.toggle("docked", docked);
  draw(sheet, drawSheet());
  if (!sheet.open && docked) sheet.show();
  else if (!sheet.open) sheet.showModal();
  opened?.();
  store.emit("sheet");
}

export const closeSheet = () => byId("sheet", HTMLDialogElement).close();

/** What the sheet shows. */
export function drawSheet() {
  if (!shown) return null;
  const { title, tools, body } = sheets[shown].content();
  return html`
    <${Fragment} key=${opening}>
      <header>
        <h2 id="sheet-title">${title}</h2>
        <span class="grow" />
        ${tools}
        <button class="tool" aria-label="Close" onClick=${closeSheet}>${icon("close")}</button>
      </header>
      ${body()}
    </${Fragment}>`;
}
