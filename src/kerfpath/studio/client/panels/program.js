/** The text of the program beside the scene; its lines are linked to places of the motion. */

import { byId, el } from "../dom.js";
import { interval } from "../kinematics.js";
import { Listing } from "./listing.js";
import { sheetShown, showSheet } from "./sheet.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../player.js").Player} Player */
/** @typedef {import("../messages.js").ProgramTextMessage} Answer */
/** @typedef {import("../messages.js").Finding} Finding */

/**
 * @param {Store} store
 * @param {Player} player
 * @param {{send: (message: any) => boolean}} connection
 */
export function programSheet(store, player, connection) {
  let language = "";
  let shown = 0; // the file
  let asked = 0; // the revision
  const listing = new Listing(go);
  const tabs = el("div", { class: "segments", role: "group", "aria-label": "File" });
  listing.element.addEventListener("keydown", (event) => {
    const way = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!way) return;
    step(way);
    event.preventDefault();
    event.stopPropagation();
  });
  byId("open-program").addEventListener("click", () =>
    ask(language || (store.job?.values?.program?.language ?? "")),
  );
  store.on(["program_text"], () => sheetShown() === "program" && draw());
  store.on(["error"], ({ about, message }) => {
    if (sheetShown() === "program" && about === "program") none(message);
  });
  store.on(["outcome"], () => {
    // What is shown follows the job.
    const { outcome } = store;
    if (sheetShown() !== "program" || !outcome || outcome.revision === asked) return;
    asked = outcome.revision;
    send(language);
  });
  player.on((moment) => {
    if (sheetShown() === "program" && store.programText) follow(moment?.t ?? 0);
  });

  /** @param {string} wanted */
  function send(wanted) {
    connection.send(wanted ? { type: "program", language: wanted } : { type: "program" });
  }

  /** @param {string} wanted */
  function ask(wanted) {
    language = wanted;
    asked = store.outcome?.revision ?? 0;
    send(wanted);
    wait(el("div", { class: "spinner" }), el("p", {}, "Writing the program"));
  }

  /** @param {...HTMLElement} body */
  function wait(...body) {
    const state = el("div", { class: "state still" }, ...body);
    showSheet("program", "Program", [languages()], [state], true);
  }

  /** @param {string} why */
  function none(why) {
    wait(el("strong", {}, "No program"), el("p", {}, why));
  }

  function languages() {
    const words = store.job?.choices["program.language"] ?? [];
    if (!words.length) return null;
    const select = el(
      "select",
      { "aria-label": "Language", onchange: () => ask(select.value) },
      ...words.map((word) => el("option", { value: word, selected: word === language }, word)),
    );
    return select;
  }

  function draw() {
    const answer = store.programText;
    if (!answer) return;
    language = answer.language;
    shown = Math.min(shown, Math.max(0, answer.files.length - 1));
    const { files } = answer;
    tabs.replaceChildren(
      ...(files.length > 1
        ? files.map(({ name }, i) => el("button", { onclick: () => pick(answer, i) }, name))
        : []),
    );
    const state = el(
      "div",
      { class: "state still" },
      el("strong", {}, "No program"),
      el("p", {}, "It is written once every contour has a plan that passes its audit."),
    );
    const focused = listing.element === document.activeElement;
    const title = files.length === 1 ? files[0].name : "Program";
    const body = files.length ? [listing.element, footer(answer)] : [state];
    showSheet("program", title, [tabs, languages()], [said(answer), ...body], true);
    if (!files.length) return;
    pick(answer, shown);
    if (focused) listing.element.focus();
    follow(player.moment?.t ?? 0);
  }

  /** @param {Answer} answer */
  function footer({ files }) {
    const linked = files.some(({ lines }) => lines.length) && player.timeline.whole;
    const words = linked
      ? "Click a line, or use the arrow keys, to move the robot there; the current line is marked."
      : "Programs in this language are not read back, so their lines are not linked to the scene.";
    return el("footer", {}, el("span", { class: "quiet" }, words));
  }

  /** @param {Answer} answer */
  function said({ faults, findings, notes }) {
    const items = [
      ...faults.map((each) => el("li", { class: "fault" }, each)),
      ...findings.map(found),
      ...notes.map((each) => el("li", {}, each)),
    ];
    return items.length ? el("ul", { class: "notes" }, ...items) : null;
  }

  /** @param {Finding} finding */
  function found({ level, message, place, file, line }) {
    const bad = { class: level === "error" ? "fault" : null };
    if (file === null || line === null) return el("li", bad, `${place}: ${message}`);
    const to = el(
      "button",
      { class: "link", onclick: () => jump(file, line) },
      `${file}, line ${line}`,
    );
    return el("li", bad, to, ` (${place}): ${message}`);
  }

  /**
   * @param {Answer} answer
   * @param {number} i
   */
  function pick({ files }, i) {
    shown = i;
    listing.load(files[i].text);
    [...tabs.children].forEach((tab, j) => tab.setAttribute("aria-pressed", String(i === j)));
  }

  /**
   * Show a line and go there.
   * @param {string} file
   * @param {number} line
   */
  function jump(file, line) {
    const answer = store.programText;
    const i = answer?.files.findIndex(({ name }) => name === file) ?? -1;
    if (!answer || i < 0) return;
    if (i !== shown) pick(answer, i);
    go(line);
    listing.mark(line);
  }

  /**
   * Go to the place of a line, or of the next line that is linked.
   * @param {number} line
   */
  function go(line) {
    const file = store.programText?.files[shown];
    if (!file || !player.timeline.whole) return;
    const k = file.lines.findIndex((each) => each >= line);
    if (k < 0) return;
    player.pause();
    player.seek(file.end[k]);
    listing.mark(file.lines[k]); // several lines may end at that time
  }

  /**
   * Go to the next or the previous linked line.
   * @param {number} way  1 or -1
   */
  function step(way) {
    const file = store.programText?.files[shown];
    if (!file) return;
    const { lines } = file;
    const next =
      way > 0
        ? lines.find((each) => each > listing.line)
        : lines.findLast((each) => each < listing.line);
    if (next !== undefined) go(next);
  }

  /**
   * Mark the line that runs at a time.
   * @param {number} t  s
   */
  function follow(t) {
    const answer = store.programText;
    if (!answer?.files.length || !player.timeline.whole) return;
    const near = 1e-5; // s: times are sent to a microsecond
    // The line that ends next; the robot may also be before the first one.
    let [at, line, soonest] = [-1, 0, Infinity];
    answer.files.forEach(({ lines, end }, i) => {
      const k = !end.length || end[0] >= t - near ? 0 : interval([...end, Infinity], t - near) + 1;
      if (k < end.length && end[k] < soonest) [at, line, soonest] = [i, lines[k], end[k]];
    });
    if (at < 0) return;
    if (at !== shown) pick(answer, at);
    if (line !== listing.line) listing.mark(line);
  }
}
