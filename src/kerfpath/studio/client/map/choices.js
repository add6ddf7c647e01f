/** The shade of the map, and the course of another technique beside the plan's. */

import { byId, el } from "../dom.js";
import { digits, fixed } from "../format.js";
import { Shade } from "./shade.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../messages.js").TechniqueMessage} TechniqueMessage */
/** @typedef {import("./grid.js").Grid} Grid */

/** Techniques by the names of the server. */
export const TECHNIQUES = { paper: "paper's procedure", known: "known technique" };

export class Choices {
  /**
   * @param {Store} store
   * @param {{send: (message: any) => boolean}} connection
   * @param {() => void} changed
   */
  constructor(store, connection, changed) {
    this.store = store;
    this.connection = connection;
    this.changed = changed;
    this.by = "";
    this.method = "";
    /** @type {Record<string, string>} the last request, by kind */
    this.asked = {};
    /** @type {Record<string, string>} why it was refused, by kind */
    this.refused = {};
    /** @type {Shade | null} */
    this.shade = null;
    /** @type {TechniqueMessage | null} */
    this.technique = null;
    this.shadeBox = byId("map-shade", HTMLSelectElement);
    this.techniqueBox = byId("map-technique", HTMLSelectElement);
    this.shadeBox.addEventListener("change", () => {
      this.by = this.shadeBox.value;
      if (!this.by) this.ask("shade", "", { by: null });
      changed();
    });
    this.techniqueBox.replaceChildren(
      el("option", { value: "" }, "nothing"),
      ...Object.entries(TECHNIQUES).map(([value, words]) => el("option", { value }, words)),
    );
    this.techniqueBox.addEventListener("change", () => {
      this.method = this.techniqueBox.value;
      if (!this.method) this.ask("technique", "", { method: null });
      changed();
    });
    store.on(["error"], ({ about, message }) => {
      if (!(about in this.asked)) return;
      this.refused[about] = message;
      changed();
    });
    store.on(["scene"], () => (this.asked = {})); // robot or cell may have changed
  }

  /**
   * Ask for something, once; an empty key stops its computation.
   * @param {"shade" | "technique"} kind
   * @param {string} key
   * @param {object} what
   */
  ask(kind, key, what) {
    const { connection, store } = this;
    if ((key && this.asked[kind] === key) || !store.selected) return;
    if (!connection.send({ type: kind, contour: store.selected, ...what })) return;
    this.asked[kind] = key;
    delete this.refused[kind];
  }

  /**
   * Take the known data for a map, and ask for the rest.
   * @param {Grid | null} grid
   */
  load(grid) {
    const { store, by, method } = this;
    if (store.connection !== "open") this.asked = {};
    const shades = grid?.message.shades ?? [];
    const list = [
      { by: "", words: "reason only" },
      ...shades.map((each) => ({ by: each.by, words: each.words })),
    ];
    if (
      list.length !== this.shadeBox.length ||
      list.some((e, i) => this.shadeBox.options[i].value !== e.by)
    )
      this.shadeBox.replaceChildren(
        ...list.map((each) => el("option", { value: each.by }, each.words)),
      );
    const wanted = grid && shades.some((each) => each.by === by) ? by : "";
    this.shadeBox.value = wanted;
    this.techniqueBox.disabled = this.shadeBox.disabled = !grid?.layers.length;
    const contour = grid?.message.contour ?? "";
    const shade = wanted ? store.shades.get(`${contour} ${wanted}`) : undefined;
    const fits = shade?.graph === grid?.message.graph;
    if (!shade || !fits) this.shade = null;
    else if (this.shade?.message !== shade) this.shade = new Shade(shade);
    if (grid && wanted && !fits)
      this.ask("shade", `${contour} ${grid.message.graph} ${wanted}`, { by: wanted });
    this.technique = (method && store.techniques.get(`${contour} ${method}`)) || null;
    const done = (store.plans.get(contour) ?? []).every(({ passed }) => passed !== null);
    if (grid && method && done && !this.fresh(contour))
      this.ask("technique", `${contour} ${method} ${this.revision(contour)}`, { method });
  }

  /** @param {string} contour */
  revision(contour) {
    const { plans, nopaths } = this.store;
    return (plans.get(contour)?.[0] ?? nopaths.get(contour))?.revision ?? 0;
  }

  /**
   * Whether the other course is for the same job as the plan.
   * @param {string} contour
   */
  fresh(contour) {
    return this.technique !== null && this.technique.revision >= this.revision(contour);
  }

  /** The course beside the plan's. */
  get course() {
    const { technique } = this;
    return technique?.s.length ? { ...technique, name: TECHNIQUES[technique.method] } : null;
  }

  /**
   * Return the legend of the shade and of the other course.
   * @param {Grid} grid
   * @returns {Node[]}
   */
  legend(grid) {
    const nodes = [];
    const waiting = (/** @type {string} */ kind, /** @type {string} */ words) =>
      el("p", { class: "quiet" }, this.refused[kind] ?? words);
    if (this.shadeBox.value)
      nodes.push(
        ...(this.shade?.legend() ?? [waiting("shade", "Shades are being computed \u2026")]),
      );
    if (this.method) nodes.push(...this.beside(grid.message.contour, waiting));
    return nodes.length
      ? [el("section", { class: "shades", "aria-live": "polite" }, ...nodes)]
      : [];
  }

  /**
   * Return the results of the other technique.
   * @param {string} contour
   * @param {(kind: string, words: string) => Node} waiting
   * @returns {Node[]}
   */
  beside(contour, waiting) {
    const { technique } = this;
    const name = TECHNIQUES[/** @type {keyof typeof TECHNIQUES} */ (this.method)];
    const head = el("p", { class: "technique" }, el("i", { class: "line dots" }), name);
    const late = this.fresh(contour) ? [] : [waiting("technique", "Being computed \u2026")];
    if (!technique) return [head, ...late];
    const notes = technique.notes.map((each) => el("p", { class: "quiet" }, each));
    if (technique.cost === null)
      return [
        head,
        ...late,
        el(
          "details",
          {},
          el("summary", {}, "finds no path"),
          el("p", {}, technique.statement),
          ...notes,
        ),
      ];
    return [
      head,
      ...late,
      el("p", {}, `cost ${digits(technique.cost, 4)}`),
      peak("speed", technique.peak_velocity),
      peak("acceleration", technique.peak_acceleration),
      ...notes,
    ];
  }
}

/**
 * Show the largest share of a limit and its joint, highlighted if the limit is broken.
 * @param {string} words
 * @param {(number | null)[]} shares
 */
function peak(words, shares) {
  const all = shares.map((each) => each ?? Infinity);
  const most = Math.max(...all);
  const joint = all.indexOf(most) + 1;
  return el(
    "p",
    most > 1 ? { class: "over" } : {},
    `peak ${words} ${fixed(most, 2)} \u00d7 limit, joint ${joint}`,
  );
}
