/** Files of this machine for the cell: buttons that open them, and their way to the server. */

import { store } from "../app.js";
import { html, icon, redraw } from "../ui.js";

/** @typedef {{reading: string, why: string}} State  the file that is read; why the last was refused */

/**
 * A button that opens a file of this machine.
 * @param {string} words
 * @param {string[]} suffixes
 * @param {(file: File) => void} take
 * @param {boolean} [disabled]
 */
export function opener(words, suffixes, take, disabled = false) {
  const pick = (/** @type {any} */ { target }) => {
    if (target.files.length) take(target.files[0]);
    target.value = ""; // the same file may be opened again
  };
  return html`
    <label class="plain">
      ${icon("file")}${words}
      <input type="file" class="unseen" accept=${suffixes.join(",")}
        disabled=${!store.live || disabled} onChange=${pick} />
    </label>`;
}

/** Files are sent one after the other. */
let turn = Promise.resolve();

/**
 * Send a file to the server.
 * @param {State} state
 * @param {File} file
 * @param {"part" | "solid"} what
 * @param {() => Record<string, string>} query  when its turn has come
 * @param {(answer: string) => void} [done]
 */
export function sent(state, file, what, query, done = () => {}) {
  turn = turn.then(async () => {
    Object.assign(state, { reading: file.name, why: "" });
    redraw();
    try {
      const address = `${what}/${encodeURIComponent(file.name)}?${new URLSearchParams(query())}`;
      const answer = await fetch(address, { method: "POST", body: file });
      const text = await answer.text();
      if (answer.ok) done(text);
      else state.why = text;
    } catch {
      state.why = "The studio's server does not answer; try again.";
    }
    state.reading = "";
    redraw();
  });
}

/**
 * What is said of a file: that it is read, why it was refused, or a hint.
 * @param {State} state
 * @param {string} hint
 */
export const said = ({ reading, why }, hint) => html`
  <p class="quiet small" aria-live="polite">${reading ? `Reading ${reading} …` : hint}</p>
  ${why && html`<p class="fault" role="alert">${why}</p>`}`;
