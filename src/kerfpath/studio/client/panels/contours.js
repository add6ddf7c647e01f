/** The list of contours with the state of their plans; one of them is chosen. */

import { byId, el, icon } from "../dom.js";
import { clock, fixed } from "../format.js";

/** @typedef {import("../store.js").Store} Store */

/** The state of a contour: the class of its dot, and words. */
/** @typedef {{dot: "done" | "none" | "warn" | "busy" | "open", words: string}} Standing */

/**
 * Return the state of a contour.
 * @param {Store} store
 * @param {string} name
 * @returns {Standing}
 */
export function standing(store, name) {
  const nopath = store.nopaths.get(name);
  const plans = store.plans.get(name);
  if (nopath && !store.stale(nopath)) return { dot: "none", words: "no path" };
  if (!plans || plans.some((plan) => store.stale(plan)))
    return store.progress.busy
      ? { dot: "busy", words: plans ? "planning again" : "planning" }
      : { dot: "open", words: plans ? "out of date" : "not planned" };
  if (plans.some((plan) => plan.passed === false)) return { dot: "warn", words: "fails its audit" };
  if (plans.some((plan) => plan.passed === null))
    return store.progress.busy
      ? { dot: "busy", words: "being refined" }
      : { dot: "done", words: "planned" };
  return { dot: "done", words: "audited" };
}

/** @param {Store} store */
export function contourList(store) {
  const host = byId("contours");
  /** @type {string} */
  let drawn = "";
  store.on(["scene", "job", "plan", "selected", "progress"], () => draw());
  store.on(["program", "outcome"], () => cycle(store));
  draw();

  function draw() {
    const rows = (store.scene?.contours ?? []).map((shape) => ({
      shape,
      ...standing(store, shape.name),
      seconds: (store.plans.get(shape.name) ?? []).reduce(
        (sum, { time }) => sum + time[time.length - 1],
        0,
      ),
    }));
    const key = JSON.stringify([
      rows.map(({ shape, ...rest }) => [shape.name, shape.s.length, rest]),
      store.selected,
    ]);
    if (key === drawn) return;
    drawn = key;
    const focused = host.contains(document.activeElement);
    host.replaceChildren(
      ...rows.map(({ shape, dot, words, seconds }) =>
        el(
          "button",
          {
            "aria-current": String(shape.name === store.selected),
            title: `${shape.name}: ${fixed(shape.s[shape.s.length - 1] * 1e3, 0)} mm, ${words}`,
            onclick: () => store.select(shape.name),
          },
          el("i", { class: `dot ${dot}` }),
          el("span", { class: "name" }, shape.name),
          el("span", { class: "time" }, seconds ? `${fixed(seconds, 1)} s` : ""),
          dot === "none" || dot === "warn" ? el("span", { class: "more" }, words) : null,
        ),
      ),
    );
    if (!rows.length)
      host.replaceChildren(
        el(
          "p",
          { class: "empty" },
          store.scene ? "The job has no contour. Add one under Job file." : "Reading the drawing …",
        ),
      );
    if (focused)
      /** @type {HTMLElement | null} */ (host.querySelector("[aria-current=true]"))?.focus();
  }
}

/**
 * Write the cycle time and the notes of the program.
 * @param {Store} store
 */
function cycle(store) {
  const { program, outcome } = store;
  const notes = [...new Set([...(program?.notes ?? []), ...(outcome?.notes ?? [])])];
  const known = outcome && program && outcome.revision === program.revision ? outcome.cycle : null;
  const total = known?.total ?? program?.total ?? 0;
  byId("cycle").replaceChildren(
    ...(total
      ? [
          el(
            "div",
            { class: "total" },
            el("span", {}, "Cycle time"),
            el("b", {}, total < 60 ? `${fixed(total)} s` : `${clock(total)} min`),
          ),
          ...(known
            ? [
                bar(known),
                el(
                  "p",
                  { class: "quiet" },
                  `Cutting ${fixed(known.cutting)} s, transfer ${fixed(known.air)} s, piercing ${fixed(known.piercing)} s`,
                ),
              ]
            : []),
        ]
      : []),
    ...(notes.length
      ? [
          el(
            "details",
            {},
            el(
              "summary",
              {},
              icon("warning"),
              notes.length > 1 ? `${notes.length} notes on the program` : "A note on the program",
            ),
            ...notes.map((note) => el("p", {}, note)),
          ),
        ]
      : []),
  );
}

/** @param {{cutting: number, air: number, piercing: number, total: number}} times */
function bar({ cutting, air, piercing }) {
  const strip = el("div", { class: "shares", "aria-hidden": "true" });
  for (const [seconds, colour] of /** @type {[number, string][]} */ ([
    [cutting, "--cut"],
    [air, "--moving"],
    [piercing, "--pierce"],
  ])) {
    const part = el("i");
    part.style.flexGrow = String(seconds);
    part.style.background = `var(${colour})`;
    if (seconds) strip.append(part);
  }
  return strip;
}
