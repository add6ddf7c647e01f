/** The text of the job in a sheet over the page, for reading and editing. */

import { byId, el } from "../dom.js";
import { showSheet } from "./sheet.js";

/** @typedef {import("../store.js").Store} Store */

/**
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 */
export function jobSheet(store, connection) {
  const sheet = byId("sheet", HTMLDialogElement);
  byId("open-text").addEventListener("click", open);

  function open() {
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
            "Changes here are one step of undo. The job file is only written with Save job.",
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
}
