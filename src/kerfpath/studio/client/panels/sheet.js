/** The sheet of the page: over the page, or docked beside the scene, which stays usable. */

import { byId, el, icon } from "../dom.js";

/** @typedef {"job" | "program" | "loops" | "layout"} Name */

/** @type {Name | null} */
let shown = null;

/** What the sheet shows, or null. */
export const sheetShown = () => shown;

/**
 * Show content in the sheet, in place of its previous content.
 * @param {Name} name
 * @param {string} title
 * @param {(Node | null)[]} tools
 * @param {(Node | null)[]} body
 * @param {boolean} [docked]  beside the scene, not over it
 */
export function showSheet(name, title, tools, body, docked = false) {
  const sheet = byId("sheet", HTMLDialogElement);
  prepare(sheet);
  const close = el(
    "button",
    { class: "tool", "aria-label": "Close", onclick: () => sheet.close() },
    icon("close"),
  );
  if (sheet.open && sheet.classList.contains("docked") !== docked) sheet.close();
  shown = name;
  sheet.dataset.shows = name;
  sheet.classList.toggle("docked", docked);
  sheet.replaceChildren(
    el(
      "header",
      {},
      el("h2", { id: "sheet-title" }, title),
      el("span", { class: "grow" }),
      ...tools.filter((each) => each !== null),
      close,
    ),
    ...body.filter((each) => each !== null),
  );
  if (sheet.open) return;
  if (docked) sheet.show();
  else sheet.showModal();
}

/** @param {HTMLDialogElement} sheet */
function prepare(sheet) {
  if (sheet.dataset.ready) return;
  sheet.dataset.ready = "yes";
  sheet.addEventListener("close", () => {
    if (!sheet.open) shown = null;
  });
  sheet.addEventListener("click", (event) => {
    if (event.target === sheet && !sheet.classList.contains("docked")) sheet.close();
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && sheet.open && sheet.classList.contains("docked")) sheet.close();
  });
}
