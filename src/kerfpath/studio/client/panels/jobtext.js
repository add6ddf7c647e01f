/** The text of the job in a sheet over the page, for reading and editing. */

import { useEffect, useRef, useState } from "preact/hooks";

import { send, store } from "../app.js";
import { html } from "../ui.js";
import { closeSheet } from "./sheet.js";

/** @type {import("./sheet.js").Sheet} */
export const jobSheet = {
  docked: false,
  content: () => ({ title: store.job?.name ?? "Job", body: () => html`<${JobText} />` }),
};

function JobText() {
  const [text, type] = useState(store.job?.text ?? "");
  const area = useRef(/** @type {HTMLTextAreaElement | null} */ (null));
  useEffect(() => {
    area.current?.focus();
    area.current?.setSelectionRange(0, 0);
    area.current?.scrollTo(0, 0);
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
