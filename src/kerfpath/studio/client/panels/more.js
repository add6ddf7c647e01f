/** All options: a control for every planning key of the job, and a search. */

import { axesOf } from "../axes.js";
import { byId, el, icon } from "../dom.js";
import { EXTERNAL, GROUPS, SAMPLINGS, externalKeys } from "./keys.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../messages.js").Path} Path */
/** @typedef {import("../messages.js").Edit} Edit */
/** @typedef {import("./keys.js").Key} Key */

/**
 * @typedef {object} Row
 * @property {HTMLElement} element
 * @property {() => void} show
 * @property {() => boolean} given
 * @property {string} words  that the search looks in
 */

/**
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 * @param {{moment: {q: number[]} | null}} player
 */
export function morePanel(store, connection, player) {
  const host = byId("more");
  const groups = GROUPS.map(({ title, contour, keys }) => {
    const rows = keys.map(row);
    if (title === "The cut") rows.unshift(sampling());
    const count = el("span", { class: "quiet" });
    const fold = el(
      "details",
      { class: "group-of-keys", hidden: !rows.length },
      el("summary", {}, title, contour ? el("small", {}, " this contour") : null, count),
      ...rows.map(({ element }) => element),
    );
    return { title, rows, count, fold };
  });
  const none = el("p", { class: "quiet small", hidden: true }, "No option matches.");
  const find = el("input", {
    ...{ type: "search", class: "find", placeholder: "Find an option" },
    ...{ "aria-label": "Find an option", oninput: filter },
  });
  host.replaceChildren(
    el(
      "section",
      { class: "card" },
      el("header", {}, el("h2", {}, "All options"), el("span", { class: "grow" }), find),
      ...groups.map(({ fold }) => fold),
      none,
    ),
  );
  let built = "";
  store.on(["job", "selected", "connection", "scene"], draw);
  draw();

  /** Build controls for the keys of each external axis of the job. */
  function build() {
    const keys = externalKeys(store.job?.values?.robot.external ?? []);
    const now = JSON.stringify(keys);
    const own = groups.find(({ title }) => title === EXTERNAL);
    if (!own || !store.job?.values || now === built) return;
    built = now;
    for (const { element } of own.rows) element.remove();
    own.rows = keys.map(row);
    own.fold.append(...own.rows.map(({ element }) => element));
    filter();
  }

  function draw() {
    host.hidden = !store.job;
    build();
    for (const { rows, count } of groups) {
      rows.forEach((each) => each.show());
      const set = rows.filter((each) => each.given()).length;
      count.textContent = set ? ` ${set} set` : "";
    }
  }

  function filter() {
    const wanted = find.value.trim().toLowerCase().split(/\s+/).filter(Boolean);
    let found = 0;
    for (const { title, rows, fold } of groups) {
      const fits = rows.filter(({ words }) =>
        wanted.every((word) => `${title} ${words}`.toLowerCase().includes(word)),
      );
      for (const each of rows) each.element.hidden = !fits.includes(each);
      fold.hidden = !fits.length;
      fold.open = wanted.length > 0 && fits.length > 0;
      found += fits.length;
    }
    none.hidden = found > 0;
  }

  /** The index of the chosen contour's table in the job. */
  function table() {
    return store.job?.contours.find(({ name }) => name === store.selected)?.index ?? 0;
  }

  /**
   * Return the path of a dotted key in the job.
   * @param {string} key
   * @returns {Path}
   */
  function path(key) {
    const [first, ...rest] = key.split(".");
    const inner = rest.map((part) => (/^\d+$/.test(part) ? Number(part) : part));
    return first === "contour" ? [first, table(), ...inner] : [first, ...inner];
  }

  /** @param {string} key */
  function value(key) {
    /** @type {any} */
    let found = store.job?.values;
    for (const part of path(key)) found = found?.[part];
    return found ?? null;
  }

  /** @param {string} key */
  function given(key) {
    return store.job?.given.includes(path(key).join(".")) ?? false;
  }

  /** @param {[string, unknown][]} changes */
  function send(...changes) {
    const edits = changes.map(([key, to]) => ({ path: path(key), value: to }));
    connection.send({ type: "edits", edits });
  }

  /**
   * Set a key, and a key that must be used with it; null removes it from the job.
   * @param {Key} what
   * @param {unknown} to
   */
  function set({ key, table: whole, beside }, to) {
    if (to === null && whole) return send([whole, null]);
    const parent = key.slice(0, key.lastIndexOf("."));
    const held = `${path(parent).join(".")}.`;
    const alone = store.job?.given.filter((each) => each.startsWith(held)).length === 1;
    // Remove a nested table that would be empty.
    if (to === null && alone && parent.includes(".")) return send([parent, null]);
    if (!beside) return send([key, to]);
    const [other, usual] = beside;
    if (to === null) send([key, null], [other, null]);
    else if (value(other) === null && usual) send([key, to], [other, usual]);
    else send([key, to]);
  }

  /**
   * @param {Key} what
   * @returns {Row}
   */
  function row(what) {
    const { key, label, unit = "", hint = "", needs } = what;
    const id = `key-${key.replaceAll(".", "-")}`;
    const control = { number, words, switch: onOff, table: present, list, joints }[what.kind](
      what,
      id,
    );
    const reset = el(
      "button",
      {
        ...{ class: "tool reset", title: "Reset to default" },
        "aria-label": `${label}: reset to default`,
        onclick: () => set(what, null),
      },
      icon("reset"),
    );
    const fault = el("p", { class: "fault", id: `${id}-fault`, hidden: true });
    const element = el(
      "div",
      { class: "option", title: hint || null },
      el("label", { for: id }, label),
      el("span", { class: "value" }, control.element, el("span", { class: "unit" }, unit), reset),
      fault,
    );
    return {
      element,
      words: `${label} ${key} ${hint}`,
      given: () => given(key),
      show() {
        const without = needs !== undefined && !value(needs);
        const disabled = store.connection !== "open" || !store.job?.values || without;
        control.show(value(key), disabled);
        // A key that is not in the job has nothing to reset.
        reset.style.visibility = given(key) && !disabled ? "visible" : "hidden";
        const at = path(key).join(".");
        const wrong = store.job?.faults.find((each) => each.key.join(".") === at)?.message ?? "";
        fault.textContent = wrong;
        fault.hidden = !wrong;
        control.input.setAttribute("aria-invalid", String(Boolean(wrong)));
      },
    };
  }

  /** @typedef {{element: HTMLElement, input: HTMLElement, show: (value: any, disabled: boolean) => void}} Control */

  /**
   * A text field, which is empty if there is no value.
   * @param {string} id
   * @param {Record<string, string>} attributes
   * @param {(text: string) => void} take
   */
  function typed(id, attributes, take) {
    const input = el("input", {
      ...{ id, placeholder: "none", "aria-describedby": `${id}-fault`, ...attributes },
      onchange: () => take(input.value),
      onkeydown: (/** @type {KeyboardEvent} */ event) => event.key === "Enter" && input.blur(),
    });
    return {
      element: input,
      input,
      /** @type {Control["show"]} */
      show(now, disabled) {
        input.disabled = disabled;
        if (document.activeElement !== input) input.value = [now ?? []].flat().join(", ");
      },
    };
  }

  /**
   * @param {Key} what
   * @param {string} id
   * @returns {Control}
   */
  function number(what, id) {
    const kind = { class: "number", type: "number", step: "any", inputmode: "decimal" };
    return typed(id, kind, (text) => {
      if (text !== "") set(what, Number(text));
      else if (given(what.key)) set(what, null);
    });
  }

  /**
   * @param {Key} what
   * @param {string} id
   * @returns {Control}
   */
  function words(what, id) {
    const input = el("select", { id, onchange: () => set(what, input.value || null) });
    return {
      element: input,
      input,
      show(now, disabled) {
        input.disabled = disabled;
        const known = store.job?.choices[what.key] ?? [];
        const all = now !== null && !known.includes(now) ? [now, ...known] : known;
        const blank = now === null ? ["", ...all] : all;
        if (input.dataset.words !== blank.join(" ")) {
          input.dataset.words = blank.join(" ");
          input.replaceChildren(...blank.map((word) => el("option", { value: word }, word)));
        }
        input.value = now ?? "";
      },
    };
  }

  /**
   * @param {Key} what
   * @param {string} id
   * @returns {Control}
   */
  function onOff(what, id) {
    const input = el("input", { id, type: "checkbox", onchange: () => set(what, input.checked) });
    return {
      element: input,
      input,
      show(now, disabled) {
        input.disabled = disabled;
        input.checked = now === true;
        input.indeterminate = now === null;
        input.title = now === null ? "as the method requires" : "";
      },
    };
  }

  /**
   * @param {Key} what
   * @param {string} id
   * @returns {Control}
   */
  function present(what, id) {
    const input = el("input", {
      ...{ id, type: "checkbox" },
      onchange: () => send([what.key, input.checked ? {} : null]),
    });
    return {
      element: input,
      input,
      show(now, disabled) {
        input.disabled = disabled;
        input.checked = now !== null;
      },
    };
  }

  /**
   * @param {Key} what
   * @param {string} id
   * @returns {Control}
   */
  function list(what, id) {
    const field = typed(id, { class: "wide" }, (text) => {
      const found = text
        .split(/[\s,;]+/)
        .filter(Boolean)
        .map(Number);
      if (found.length && found.every(Number.isFinite)) set(what, found);
      else if (!found.length && given(what.key)) set(what, null);
      else field.input.setAttribute("aria-invalid", "true");
    });
    return field;
  }

  /**
   * @param {Key} what
   * @param {string} id
   * @returns {Control}
   */
  function joints(what, id) {
    const { input, show } = list(what, id);
    const take = () => {
      const { moment } = player;
      if (!moment) return;
      const axes = axesOf(store.scene?.robot);
      const at = axes.map(({ of }, j) => Number(of(moment.q[j]).toFixed(2)));
      const arm = axes.filter(({ external }) => !external).length;
      /** @type {[string, unknown][]} */
      const others = axes
        .slice(arm)
        .map(({ unit }, i) => [`robot.external.${i}.home_${unit}`, at[arm + i]]);
      send([what.key, at.slice(0, arm)], ...others);
    };
    const words = { title: "Take the shown pose", "aria-label": "Take the shown pose" };
    const here = el("button", { ...words, class: "tool", onclick: take }, icon("follow"));
    return {
      element: el("span", { class: "value" }, input, here),
      input,
      show(now, disabled) {
        here.disabled = disabled;
        show(now, disabled);
      },
    };
  }

  /**
   * The sampling of the contour, which has one of several keys.
   * @returns {Row}
   */
  function sampling() {
    const held = () =>
      /** @type {(keyof typeof SAMPLINGS)[]} */ (Object.keys(SAMPLINGS)).find(
        (key) => value(`contour.${key}`) !== null,
      ) ?? "spacing_mm";
    const by = el(
      "select",
      {
        "aria-label": "Nodes by",
        onchange: () => {
          const to = /** @type {keyof typeof SAMPLINGS} */ (by.value);
          const others = Object.keys(SAMPLINGS).filter(
            (key) => key !== to && given(`contour.${key}`),
          );
          send(
            ...others.map((key) => /** @type {[string, unknown]} */ ([`contour.${key}`, null])),
            ...(to === "tolerance_mm" || !given("contour.axis_tolerance_deg")
              ? []
              : [/** @type {[string, unknown]} */ (["contour.axis_tolerance_deg", null])]),
            [`contour.${to}`, SAMPLINGS[to].usual],
          );
        },
      },
      ...Object.entries(SAMPLINGS).map(([key, { label }]) => el("option", { value: key }, label)),
    );
    const input = el("input", {
      ...{ id: "key-sampling", class: "number", type: "number", step: "any", inputmode: "decimal" },
      onchange: () => input.value !== "" && send([`contour.${held()}`, Number(input.value)]),
      onkeydown: (/** @type {KeyboardEvent} */ event) => event.key === "Enter" && input.blur(),
    });
    const unit = el("span", { class: "unit" });
    const room = el("span", { class: "reset tool", "aria-hidden": "true" });
    return {
      words: "nodes by spacing time step tolerance count sampling spacing_mm time_step_ms",
      given: () => false,
      element: el(
        "div",
        { class: "option" },
        el("span", {}, el("label", { for: "key-sampling" }, "Nodes by "), by),
        el("span", { class: "value" }, input, unit, room),
      ),
      show() {
        by.disabled = input.disabled = store.connection !== "open" || !store.job?.values;
        by.value = held();
        unit.textContent = SAMPLINGS[held()].unit;
        if (document.activeElement !== input)
          input.value = String(value(`contour.${held()}`) ?? "");
      },
    };
  }
}
