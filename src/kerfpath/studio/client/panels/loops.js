/** The loops of the part in a sheet, with buttons to add them to the job or remove them. */

import { byId, el } from "../dom.js";
import { counted } from "../format.js";
import { barred, contoursByLoop, cutLoops, described, leaving } from "../part.js";
import { sheetShown, showSheet } from "./sheet.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../messages.js").Loop} Loop */

/**
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 */
export function loopsSheet(store, connection) {
  const opener = byId("open-loops", HTMLButtonElement);
  const rows = el("div", { class: "rows" });
  const words = el("input", { type: "search", placeholder: "Find by name", "aria-label": "Find" });
  const [onlyUncut, inside] = ["Only uncut loops", "Also inner side of the sheet"].map((label) => {
    const box = el("input", { type: "checkbox", onchange: draw });
    return { box, label: el("label", {}, box, label) };
  });
  words.addEventListener("input", draw);
  opener.addEventListener("click", () => {
    draw();
    const filter = el("div", { class: "filter" }, words, onlyUncut.label, inside.label);
    showSheet("loops", "Loops of the part", [], [filter, rows, footer()], true);
    words.focus();
  });
  byId("sheet").addEventListener("close", () => store.emit("pointed", []));
  store.on(["part", "scene", "job", "connection"], () => {
    opener.disabled = store.connection !== "open" || !store.part;
    if (sheetShown() === "loops") draw();
  });

  function footer() {
    const hidden = store.part?.left_out ?? 0;
    const more = hidden
      ? ` ${counted(hidden, "loop")} of single faces of skins and around the thickness of sheets are not listed: write their names in the job file.`
      : "";
    const text = `An added loop is cut like the most similar contour of the job.${more}`;
    return el("footer", {}, el("span", { class: "quiet" }, text));
  }

  function draw() {
    const known = contoursByLoop(store);
    const all = store.part?.loops ?? [];
    inside.label.hidden = all.every(({ side }) => side !== "inner");
    const wanted = words.value.trim().toLowerCase();
    const shown = all.filter(
      (loop) =>
        (known.has(loop.name) || loop.side !== "inner" || inside.box.checked) &&
        !(onlyUncut.box.checked && known.has(loop.name)) &&
        `${loop.name} ${known.get(loop.name)?.name ?? ""}`.toLowerCase().includes(wanted),
    );
    /** @type {Map<string, Loop[]>} */
    const faces = new Map();
    for (const loop of shown) faces.set(loop.face, [...(faces.get(loop.face) ?? []), loop]);
    const focused = /** @type {HTMLElement | null} */ (document.activeElement)?.dataset?.loop;
    rows.replaceChildren(
      ...[...faces].flatMap(([face, loops]) => [heading(face, loops, known), ...loops.map(row)]),
    );
    if (!shown.length) {
      const why = all.length ? "No loop matches." : "The drawing has no loops.";
      rows.replaceChildren(el("p", { class: "empty" }, why));
    }
    if (focused !== undefined)
      [...rows.querySelectorAll("button")].find(({ dataset }) => dataset.loop === focused)?.focus();
  }

  /**
   * @param {string} face
   * @param {Loop[]} loops
   * @param {ReturnType<typeof contoursByLoop>} known
   */
  function heading(face, loops, known) {
    const left = loops.filter((loop) => !known.has(loop.name) && !barred(loop));
    const names = left.map(({ name }) => name);
    const all = el(
      "button",
      { class: "text", onclick: () => cutLoops(store, connection, names) },
      `Cut all ${left.length}`,
    );
    return el(
      "h3",
      {},
      el("span", {}, face),
      el("span", { class: "quiet" }, counted(loops.length, "loop")),
      el("span", { class: "grow" }),
      left.length > 1 ? all : null,
    );
  }

  /** @param {Loop} loop */
  function row(loop) {
    const contour = contoursByLoop(store).get(loop.name);
    const light = () => store.emit("pointed", [loop]);
    const why = barred(loop);
    const name =
      contour && contour.name !== loop.name ? `${contour.name} (${loop.name})` : loop.name;
    return el(
      "div",
      {
        class: `row ${contour ? "cut" : ""}`,
        onpointerenter: light,
        onpointerleave: () => store.emit("pointed", []),
        onfocusin: light,
      },
      el(
        "span",
        {},
        el("strong", {}, name),
        el("small", {}, why ? `${described(loop)}; ${why}` : described(loop)),
      ),
      contour ? out(loop, contour.index) : cut(loop, why),
    );
  }

  /**
   * @param {Loop} loop
   * @param {string} why
   */
  function cut({ name }, why) {
    const add = () => cutLoops(store, connection, [name]);
    const said = { "aria-label": `Cut ${name}`, "data-loop": name };
    return el("button", { class: "plain", disabled: why !== "", onclick: add, ...said }, "Cut");
  }

  /**
   * @param {Loop} loop
   * @param {number} index
   */
  function out({ name }, index) {
    const { words: text, why } = leaving(store, index);
    const leave = () => connection.send({ type: "leave", index });
    const said = { "aria-label": `${text}: ${name}`, "data-loop": name, title: why || null };
    const button = { class: "plain", disabled: why !== "", onclick: leave, ...said };
    return el("button", button, text);
  }
}
