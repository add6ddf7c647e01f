/** The main options: speed of the contour, objective, metric, posture, shares of the limits. */

import { byId, el, icon } from "../dom.js";
import { fixed } from "../format.js";
import { amount, choice, gesture } from "./fields.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../messages.js").Path} Path */

/** @type {Record<string, string>} */
const WORDS = {
  sum: "Sum",
  max: "Largest",
  euclid: "Euclid",
  manhattan: "Manhattan",
  chebychev: "Chebychev",
};

/**
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 */
export function optionsPanel(store, connection) {
  const host = byId("options");
  const send = (
    /** @type {Path} */ path,
    /** @type {unknown} */ value,
    /** @type {string} */ drag,
  ) => void connection.send({ type: "edit", path, value, gesture: drag });

  const speed = amount({
    ...{
      id: "speed",
      label: "Cutting speed",
      unit: "m/min",
      min: 0.1,
      max: 10,
      step: 0.05,
      places: 2,
    },
    send: (value, drag) => send(["contour", table(), "speed_m_min"], value, drag),
  });
  const fastest = el(
    "button",
    { class: "plain", onclick: find },
    icon("speed"),
    "Find the fastest",
  );
  const answer = el("div", { class: "answer", "aria-live": "polite" });
  const posture = el("select", {
    id: "posture",
    onchange: () => send(["plan", "posture"], posture.value || null, gesture()),
  });
  const shared = el("p", { class: "quiet small" });
  const etas = /** @type {const} */ ([
    ["eta_velocity", "Speed limits used"],
    ["eta_acceleration", "Acceleration limits used"],
  ]).map(([key, label]) => ({
    key,
    field: amount({
      ...{ id: key, label, unit: "%", min: 30, max: 100, step: 1, places: 0 },
      send: (value, drag) => send(["plan", key], Number((value / 100).toFixed(4)), drag),
    }),
  }));
  const choices = /** @type {const} */ ([
    ["objective", "Objective"],
    ["metric", "Metric"],
  ]).map(([key, label]) => ({
    key,
    field: choice(label, (value) => send(["plan", key], value, gesture())),
  }));
  /** @type {Map<string, number>} end of the speed slider, by contour */
  const reach = new Map();
  let looking = false;

  host.replaceChildren(
    el(
      "section",
      { class: "card" },
      el("header", {}, el("h2", {}, "Speed"), el("span", { class: "grow" }), fastest),
      speed.element,
      shared,
      answer,
    ),
    el(
      "section",
      { class: "card" },
      el("h2", {}, "Objective and limits"),
      ...choices.map(({ field }) => field.element),
      el("div", { class: "field row" }, el("label", { for: "posture" }, "Posture"), posture),
      ...etas.map(({ field }) => field.element),
    ),
  );
  store.on(["job", "scene", "selected", "plan", "connection"], draw);
  store.on(["fastest", "error"], (about) => {
    looking = false;
    if (about.type === "fastest") found();
    draw();
  });
  store.on(["selected", "job"], () => answer.replaceChildren());
  draw();

  /** The place of the chosen contour's table in the job. */
  function table() {
    const known = store.job?.contours.find(({ name }) => name === store.selected);
    return (
      known?.index ?? store.scene?.contours.find(({ name }) => name === store.selected)?.index ?? 0
    );
  }

  /** @param {string} key */
  function faultOf(key) {
    return store.job?.faults.find((each) => each.key.join(".") === key)?.message ?? "";
  }

  function draw() {
    const { job, scene, selected } = store;
    const values = job?.values;
    host.hidden = !job;
    const disabled = store.connection !== "open" || !values || !selected;
    const shape = scene?.contours.find(({ name }) => name === selected);
    const now = values?.contour?.[table()]?.speed_m_min ?? shape?.speed_m_min ?? 1;
    const held = reach.get(selected ?? "") ?? 0;
    const most = now > held || now < held / 5 ? nice(2 * now) : held;
    reach.set(selected ?? "", most);
    speed.show(now, { max: most, disabled, fault: faultOf(`contour.${table()}.speed_m_min`) });
    const alike = (job?.contours ?? []).filter(({ index }) => index === table()).length;
    shared.textContent =
      alike > 1 ? `Applies to all ${alike} contours that this table of the job picks.` : "";
    shared.hidden = alike < 2;
    fastest.disabled = disabled || looking;
    for (const { key, field } of etas)
      field.show(100 * (values?.plan?.[key] ?? 1), { disabled, fault: faultOf(`plan.${key}`) });
    drawPosture(disabled);
    for (const { key, field } of choices) {
      const words = job?.choices[`plan.${key}`] ?? [];
      field.show(
        values?.plan?.[key] ?? "",
        words.map((value) => ({ value, label: WORDS[value] ?? value })),
        disabled,
      );
    }
  }

  /** @param {boolean} disabled */
  function drawPosture(disabled) {
    const { job } = store;
    const held = job?.values?.plan?.posture ?? "";
    const words = job?.choices["plan.posture"] ?? (held ? [held] : []);
    const key = [held, ...words].join(" ");
    posture.disabled = disabled;
    if (posture.dataset.key === key) return;
    posture.dataset.key = key;
    const one = (/** @type {string} */ value, /** @type {string} */ text) =>
      el("option", { value, selected: value === held }, text);
    posture.replaceChildren(one("", "any"), ...words.map((word) => one(word, word)));
  }

  function find() {
    if (!store.selected || !connection.send({ type: "fastest", contour: store.selected })) return;
    looking = true;
    answer.replaceChildren(
      el(
        "p",
        { class: "waiting" },
        el("i", { class: "dot busy" }),
        "Searching for the fastest constant speed.",
      ),
    );
    fastest.disabled = true;
  }

  function found() {
    const { fastest: result } = store;
    if (!result || result.contour !== store.selected) return;
    const { speed_m_min: best, binds, edits } = result;
    answer.replaceChildren(
      el(
        "p",
        {},
        best === null ? "No feasible speed was found. " : `Fastest: ${fixed(best, 2)} m/min. `,
        el("span", { class: "quiet" }, binds && `Binding limit: ${binds}`),
      ),
      ...(edits.length
        ? [
            el(
              "button",
              {
                class: "plain",
                onclick: () => edits.forEach(({ path, value }) => send(path, value, "fastest")),
              },
              `Cut at ${fixed(best ?? 0, 2)} m/min`,
            ),
          ]
        : []),
    );
  }
}

/**
 * Return a round number not below a value.
 * @param {number} value
 */
function nice(value) {
  const unit = 10 ** Math.floor(Math.log10(value));
  return unit * ([1, 1.5, 2, 3, 5, 8, 10].find((each) => each * unit >= value - 1e-9) ?? 10);
}
