/** The loops of the part in a sheet, with buttons to add them to the job or remove them. */

import { send, store } from "../app.js";
import { byId } from "../dom.js";
import { counted } from "../format.js";
import { barred, contoursByLoop, cutLoops, described, leaving } from "../part.js";
import { html } from "../ui.js";

/** @typedef {import("../messages.js").LoopEntry} Loop */

const filter = { words: "", uncut: false, inner: false };

/** @type {import("./sheet.js").Sheet} */
export const loopsSheet = {
  docked: true,
  opened: () => byId("sheet").querySelector("input")?.focus(),
  content: () => ({ title: "Loops of the part", body }),
  closed: () => store.emit("pointed", []),
};

function body() {
  const known = contoursByLoop();
  const all = store.part?.loops ?? [];
  const wanted = filter.words.trim().toLowerCase();
  const shown = all.filter(
    ({ name, side }) =>
      (known.has(name) || side !== "inner" || filter.inner) &&
      !(filter.uncut && known.has(name)) &&
      `${name} ${known.get(name)?.name ?? ""}`.toLowerCase().includes(wanted),
  );
  const find = (/** @type {any} */ { target }) => (filter.words = target.value);
  /** @type {(key: "uncut" | "inner", words: string, hidden?: boolean) => unknown} */
  const box = (key, words, hidden = false) => {
    const toggle = () => (filter[key] = !filter[key]);
    return html`
      <label hidden=${hidden}>
        <input type="checkbox" checked=${filter[key]} onChange=${toggle} />${words}
      </label>`;
  };
  const hidden = store.part?.left_out ?? 0;
  const more = hidden
    ? ` ${counted(hidden, "loop")} of single faces of skins and around the thickness of sheets are not listed: write their names in the job file.`
    : "";
  const none = all.length ? "No loop matches." : "The drawing has no loops.";
  return html`
    <div class="filter">
      <input type="search" placeholder="Find by name" aria-label="Find"
        value=${filter.words} onInput=${find} />
      ${box("uncut", "Only uncut loops")}
      ${box(
        "inner",
        "Also inner side of the sheet",
        all.every(({ side }) => side !== "inner"),
      )}
    </div>
    <div class="rows">
      ${[...Map.groupBy(shown, ({ face }) => face)].map(([face, loops]) => [
        heading(face, loops, known),
        ...loops.map((loop) => row(loop, known)),
      ])}
      ${!shown.length && html`<p class="empty">${none}</p>`}
    </div>
    <footer>
      <span class="quiet">An added loop is cut like the most similar contour of the job.${more}</span>
    </footer>`;
}

/** @typedef {ReturnType<typeof contoursByLoop>} Known */

/** @type {(face: string, loops: Loop[], known: Known) => unknown} */
function heading(face, loops, known) {
  const left = loops.filter((loop) => !known.has(loop.name) && !barred(loop));
  const all = () => cutLoops(left.map(({ name }) => name));
  return html`
    <h3 key=${`face ${face}`}>
      <span>${face}</span>
      <span class="quiet">${counted(loops.length, "loop")}</span>
      <span class="grow" />
      ${left.length > 1 && html`<button class="text" onClick=${all}>Cut all ${left.length}</button>`}
    </h3>`;
}

/** @type {(loop: Loop, known: Known) => unknown} */
function row(loop, known) {
  const { name } = loop;
  const contour = known.get(name);
  const light = () => store.emit("pointed", [loop]);
  const why = barred(loop);
  const about = why ? `${described(loop)}; ${why}` : described(loop);
  const button = contour ? takeOut(name, contour.index) : cut(name, why);
  return html`
    <div key=${name} class=${`row ${contour ? "cut" : ""}`} onPointerEnter=${light}
      onPointerLeave=${() => store.emit("pointed", [])} onFocusIn=${light}>
      <span>
        <strong>${contour && contour.name !== name ? `${contour.name} (${name})` : name}</strong>
        <small>${about}</small>
      </span>
      ${button}
    </div>`;
}

/** @type {(name: string, why: string) => unknown} */
const cut = (name, why) => html`
  <button class="plain" disabled=${why !== ""} aria-label=${`Cut ${name}`}
    onClick=${() => cutLoops([name])}>Cut</button>`;

/** @type {(name: string, index: number) => unknown} */
function takeOut(name, index) {
  const { words, why } = leaving(index);
  return html`
    <button class="plain" disabled=${why !== ""} title=${why || null}
      aria-label=${`${words}: ${name}`} onClick=${() => send({ type: "leave", index })}>
      ${words}
    </button>`;
}
