/** The desk: its theme and the height of its lower part. The browser remembers both. */

import { byId } from "./dom.js";

const system = matchMedia("(prefers-color-scheme: dark)");
let changed = () => {};

/** Whether the theme is the dark one. */
export const isDark = () => document.documentElement.dataset.theme === "dark";

/**
 * Follow the light or dark theme of the system until another one is chosen.
 * @param {() => void} listener  called after each change
 */
export function followTheme(listener) {
  changed = listener;
  system.addEventListener("change", setTheme);
  setTheme();
}

/** Use the other theme. */
export function switchTheme() {
  const next = isDark() ? "light" : "dark";
  remember("theme", next === (system.matches ? "dark" : "light") ? null : next);
  setTheme();
}

function setTheme() {
  const usual = system.matches ? "dark" : "light";
  document.documentElement.dataset.theme = remembered("theme") ?? usual;
  changed();
}

/** Make the line between scene and map movable by pointer and keys. */
export function splitter() {
  const [desk, line] = [byId("desk"), byId("split")];
  const set = (/** @type {number} */ share) => {
    const percent = Math.round(Math.min(70, Math.max(20, share)));
    desk.style.setProperty("--lower", `${percent}%`);
    line.setAttribute("aria-valuenow", String(percent));
    remember("lower", String(percent));
  };
  const known = Number(remembered("lower"));
  if (known) set(known);
  line.addEventListener("pointerdown", (event) => {
    line.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  line.addEventListener("pointermove", (event) => {
    if (!line.hasPointerCapture(event.pointerId)) return;
    const { bottom, height } = desk.getBoundingClientRect();
    set((100 * (bottom - event.clientY)) / height);
  });
  line.addEventListener("keydown", (event) => {
    const by = { ArrowUp: 2, ArrowDown: -2 }[event.key];
    if (!by) return;
    set(Number(line.getAttribute("aria-valuenow")) + by);
    event.preventDefault();
  });
}

/** @param {string} name */
function remembered(name) {
  try {
    return localStorage.getItem(`kerfpath.${name}`);
  } catch {
    return null; // the browser stores nothing
  }
}

/** @type {(name: string, value: string | null) => void} */
function remember(name, value) {
  try {
    if (value === null) localStorage.removeItem(`kerfpath.${name}`);
    else localStorage.setItem(`kerfpath.${name}`, value);
  } catch {
    // The browser stores nothing: the next visit begins with defaults.
  }
}
