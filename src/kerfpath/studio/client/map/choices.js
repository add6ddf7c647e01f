/** The shade of the map, and the course of another technique beside the plan's. */

import { send, store } from "../app.js";
import { digits, fixed } from "../format.js";
import { SCALE_GRADIENT } from "../scene/scale.js";
import { folded, html, options } from "../ui.js";
import { Shade } from "./shade.js";

/** @typedef {import("../messages.js").TechniqueMessage} TechniqueMessage */
/** @typedef {import("./grid.js").Grid} Grid */

/** Techniques by the names of the server. */
const TECHNIQUES = { paper: "paper's procedure", known: "known technique" };

export class Choices {
  /** @param {() => void} changed */
  constructor(changed) {
    this.changed = changed;
    /** What is chosen, by kind of message: a quantity and a technique; "": none. */
    this.chosen = { shade: "", technique: "" };
    /** @type {Record<string, string>} the last request, by kind */
    this.asked = {};
    /** @type {Record<string, string>} why it was refused, by kind */
    this.refused = {};
    /** @type {Shade | null} */
    this.shade = null;
    /** @type {TechniqueMessage | null} */
    this.technique = null;
    store.on(["error"], ({ about, message }) => {
      if (!(about in this.asked)) return;
      this.refused[about] = message;
      changed();
    });
    store.on(["scene"], () => (this.asked = {})); // robot or cell may have changed
  }

  /**
   * Choose a quantity or a technique; "": none.
   * @param {"shade" | "technique"} kind
   * @param {string} name
   */
  choose(kind, name) {
    this.chosen[kind] = name;
    if (!name) this.ask(kind, "", null);
    this.changed();
  }

  /**
   * Ask for a quantity or a technique, once; an empty key stops its computation.
   * @param {"shade" | "technique"} kind
   * @param {string} key
   * @param {any} name
   */
  ask(kind, key, name) {
    const { selected: contour } = store;
    if ((key && this.asked[kind] === key) || !contour) return;
    const what = { [kind === "shade" ? "by" : "method"]: name };
    if (!send(/** @type {any} */ ({ type: kind, contour, ...what }))) return;
    this.asked[kind] = key;
    delete this.refused[kind];
  }

  /**
   * Return the chosen quantity, if a map has it.
   * @param {Grid | null} grid
   */
  by(grid) {
    return grid?.message.shades.find(({ by }) => by === this.chosen.shade)?.by ?? "";
  }

  /**
   * Take the known data for a map, and ask for the rest.
   * @param {Grid | null} grid
   */
  load(grid) {
    if (store.connection !== "open") this.asked = {};
    const [by, method] = [this.by(grid), this.chosen.technique];
    const { contour = "", graph } = grid?.message ?? {};
    const shade = by ? store.shades.get(`${contour} ${by}`) : undefined;
    const fits = shade?.graph === graph;
    if (!shade || !fits) this.shade = null;
    else if (this.shade?.message !== shade) this.shade = new Shade(shade);
    if (by && !fits) this.ask("shade", `${contour} ${graph} ${by}`, by);
    this.technique = (method && store.techniques.get(`${contour} ${method}`)) || null;
    const done = (store.plans.get(contour) ?? []).every(({ passed }) => passed !== null);
    if (grid && method && done && !this.fresh(contour))
      this.ask("technique", `${contour} ${method} ${this.revision(contour)}`, method);
  }

  /** @param {string} contour */
  revision(contour) {
    return (store.plans.get(contour)?.[0] ?? store.nopaths.get(contour))?.revision ?? 0;
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
   * The lists to choose from.
   * @param {Grid | null} grid
   */
  lists(grid) {
    const known = grid?.message.shades ?? [];
    const shades = known.map(({ by, words }) => ({ value: by, label: words }));
    const techniques = Object.entries(TECHNIQUES).map(([value, label]) => ({ value, label }));
    /** @type {(kind: "shade" | "technique", label: string, value: string, choices: {value: string, label: string}[]) => unknown} */
    const list = (kind, label, value, choices) => {
      const choose = (/** @type {any} */ { target }) => this.choose(kind, target.value);
      return html`
        <label>${label}${" "}
          <select id=${`map-${kind}`} value=${value} disabled=${!grid?.layers.length}
            onChange=${choose}>${options(choices)}</select>
        </label>`;
    };
    const none = [{ value: "", label: "reason only" }, ...shades];
    const nothing = [{ value: "", label: "nothing" }, ...techniques];
    return html`
      ${list("shade", "Shade", this.by(grid), none)}
      ${list("technique", "Beside", this.chosen.technique, nothing)}`;
  }

  /**
   * The legend of the shade and of the other course.
   * @param {Grid} grid
   */
  legend(grid) {
    const { technique: method } = this.chosen;
    if (!this.by(grid) && !method) return null;
    const { shade } = this;
    return html`
      <section class="shades" aria-live="polite">
        ${this.by(grid) && (shade ? scale(shade) : this.waiting("shade", "Shades are being computed …"))}
        ${method && this.beside(grid.message.contour)}
      </section>`;
  }

  /** @type {(kind: string, words: string) => unknown} */
  waiting(kind, words) {
    return html`<p class="quiet">${this.refused[kind] ?? words}</p>`;
  }

  /**
   * The results of the other technique.
   * @param {string} contour
   */
  beside(contour) {
    const { technique } = this;
    const name = TECHNIQUES[/** @type {keyof typeof TECHNIQUES} */ (this.chosen.technique)];
    return html`
      <p class="technique"><i class="line dots" />${name}</p>
      ${!this.fresh(contour) && this.waiting("technique", "Being computed …")}
      ${technique && found(technique)}`;
  }
}

/** @param {TechniqueMessage} technique */
function found({ cost, statement, notes, peak_velocity, peak_acceleration }) {
  if (cost === null) return folded("finds no path", [statement, ...notes]);
  return html`
    <p>cost ${digits(cost, 4)}</p>
    ${peak("speed", peak_velocity)}
    ${peak("acceleration", peak_acceleration)}
    ${notes.map((each) => html`<p class="quiet">${each}</p>`)}`;
}

/**
 * The scale of a shade.
 * @param {Shade} shade
 */
function scale(shade) {
  const { words, low, high, beyond } = shade.message;
  const [begin, end] = [shade.shown(low).split(" ")[0], shade.shown(high)];
  return html`
    <p>${beyond ? `${words} beyond the near-miss distance` : words}</p>
    <p class="scale">
      ${begin}<i class="ramp" style=${{ background: SCALE_GRADIENT }} />${beyond ? `≥ ${end}` : end}
    </p>
    ${shade.closed && html`<p class="quiet">crossed out: closer than allowed</p>`}`;
}

/**
 * The largest share of a limit and its joint, highlighted if the limit is broken.
 * @param {string} words
 * @param {(number | null)[]} shares
 */
function peak(words, shares) {
  const all = shares.map((each) => each ?? Infinity);
  const most = Math.max(...all);
  const text = `peak ${words} ${fixed(most, 2)} × limit, joint ${all.indexOf(most) + 1}`;
  return html`<p class=${most > 1 ? "over" : ""}>${text}</p>`;
}
