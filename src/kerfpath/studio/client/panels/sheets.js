/** Sheets over the page: the text of the job, to read and to change, and that of the program. */

import { byId, el } from "../dom.js";
import { sheetShown, showSheet } from "./sheet.js";

/** @typedef {import("../store.js").Store} Store */

/**
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 */
export function sheets(store, connection) {
  const sheet = byId("sheet", HTMLDialogElement);
  let language = "";
  byId("open-text").addEventListener("click", jobSheet);
  byId("open-program").addEventListener("click", () =>
    ask(language || (store.job?.values?.program?.language ?? "")),
  );
  store.on(["program_text"], () => sheetShown() === "program" && programSheet());
  store.on(["error"], ({ about, message }) => {
    if (sheetShown() === "program" && about === "program") none(message);
  });

  function jobSheet() {
    const text = el("textarea", { spellcheck: "false", "aria-label": "Text of the job" });
    text.value = store.job?.text ?? "";
    const apply = el(
      "button",
      {
        class: "primary",
        disabled: true,
        onclick: () => {
          connection.send({ type: "text", text: text.value });
          sheet.close();
        },
      },
      "Apply",
    );
    text.addEventListener("input", () => (apply.disabled = text.value === store.job?.text));
    showSheet(
      "job",
      store.job?.name ?? "Job",
      [],
      [
        text,
        el(
          "footer",
          {},
          el(
            "span",
            { class: "quiet" },
            "Changes here are one step of undo. Nothing is written to the job file before Save job.",
          ),
          el("span", { class: "grow" }),
          el("button", { class: "plain", onclick: () => sheet.close() }, "Cancel"),
          apply,
        ),
      ],
    );
    text.focus();
    text.setSelectionRange(0, 0);
    text.scrollTop = 0;
  }

  /** @param {string} wanted */
  function ask(wanted) {
    language = wanted;
    connection.send(wanted ? { type: "program", language: wanted } : { type: "program" });
    showSheet(
      "program",
      "Program",
      [languages()],
      [
        el(
          "div",
          { class: "state still" },
          el("div", { class: "spinner" }),
          el("p", {}, "Writing the program"),
        ),
      ],
    );
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

  /** @param {string} why */
  function none(why) {
    showSheet(
      "program",
      "Program",
      [languages()],
      [el("div", { class: "state still" }, el("strong", {}, "No program"), el("p", {}, why))],
    );
  }

  function programSheet() {
    const answer = store.programText;
    if (!answer) return;
    language = answer.language;
    const text = el("pre", { tabindex: 0 }, answer.files[0]?.text ?? "");
    const tabs = el("div", { class: "segments", role: "group", "aria-label": "File" });
    const pick = (/** @type {number} */ i) => {
      text.textContent = answer.files[i].text;
      [...tabs.children].forEach((tab, j) => tab.setAttribute("aria-pressed", String(i === j)));
    };
    if (answer.files.length > 1)
      tabs.append(
        ...answer.files.map(({ name }, i) =>
          el("button", { onclick: () => pick(i), "aria-pressed": String(i === 0) }, name),
        ),
      );
    const said = [
      ...answer.faults.map((each) => el("li", { class: "fault" }, each)),
      ...answer.notes.map((each) => el("li", {}, each)),
    ];
    showSheet(
      "program",
      answer.files.length === 1 ? answer.files[0].name : "Program",
      [tabs, languages()],
      [
        said.length ? el("ul", { class: "notes" }, ...said) : null,
        answer.files.length
          ? text
          : el(
              "div",
              { class: "state still" },
              el("strong", {}, "No program"),
              el("p", {}, "It is written once every contour has a plan that passes its audit."),
            ),
      ],
    );
  }
}
