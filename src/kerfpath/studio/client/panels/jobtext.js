/** The text of the job in a sheet over the page, for reading and editing. */

import { useEffect, useRef, useState } from "preact/hooks";

import { send, store } from "../app.js";
import { html } from "../ui.js";
import { closeSheet, openSheet } from "./sheet.js";

let line = 1; // that the sheet opens at

/**
 * Open the text of the job at one of its lines.
 * @param {number} at  from 1 on
 */
export function openLine(at) {
  line = at;
  openSheet("text");
  line = 1;
}

/** @type {import("./sheet.js").Sheet} */
export const jobSheet = {
  docked: false,
  content: () => ({ title: store.job?.name ?? "Job", body: () => html`<${JobText} />` }),
};

function JobText() {
  const [text, type] = useState(store.job?.text ?? "");
  const area = useRef(/** @type {HTMLTextAreaElement | null} */ (null));
  const [at] = useState(line);
  useEffect(() => {
    if (!area.current) return;
    const lines = text.split("\n");
    const begin = lines.slice(0, at - 1).join("\n").length + (at > 1 ? 1 : 0);
    area.current.focus();
    area.current.setSelectionRange(begin, at > 1 ? begin + lines[at - 1].length : begin);
    const height = area.current.scrollHeight / lines.length;
    area.current.scrollTo(0, Math.max(0, (at - 4) * height));
  }, []);
  const apply = () => {
    send({ type: "text", text });
    closeSheet();
  };
  const typed = (/** @type {any} */ { target }) => type(target.value);
  return html`
    <textarea ref=${area} spellcheck=${false} aria-label="Text of the job" value=${text}
      onInput=${typed} />
    <footer>
      <span class="quiet">
        Changes here are one step of undo. The job file is only written with Save job.
      </span>
      <span class="grow" />
      <button class="plain" onClick=${closeSheet}>Cancel</button>
      <button class="primary" disabled=${text === store.job?.text} onClick=${apply}>Apply</button>
    </footer>`;
}
