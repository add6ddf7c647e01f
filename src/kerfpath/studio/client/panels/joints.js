/** The joints of the robot: a slider for each weight, and the motion and load of each joint. */

import { axesOf } from "../axes.js";
import { byId, el, icon } from "../dom.js";
import { UNITS, digits, fixed } from "../format.js";
import { gesture, weight } from "./fields.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../messages.js").PlanMessage} PlanMessage */

/**
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 */
export function jointsPanel(store, connection) {
  const host = byId("joints");
  const send = (/** @type {number[] | null} */ value, /** @type {string} */ drag) =>
    void connection.send({ type: "edit", path: ["plan", "weights"], value, gesture: drag });
  const usual = el(
    "button",
    {
      class: "text",
      title: "Remove the weights from the job: each joint is then weighted by its speed limit",
      onclick: () => send(null, gesture()),
    },
    icon("reset"),
    "Default weights",
  );
  const [body, units] = [el("tbody"), el("span")];
  const table = el(
    "table",
    { class: "joints" },
    el(
      "thead",
      {},
      el(
        "tr",
        {},
        ...[
          ["", ""],
          ["weight", "× default"],
          ["moves", units],
          ["speed", "% limit"],
          ["accel.", "% limit"],
        ].map(([name, unit]) => el("th", { scope: "col" }, name, el("small", {}, unit))),
      ),
    ),
    body,
  );
  host.replaceChildren(
    el(
      "section",
      { class: "card" },
      el("header", {}, el("h2", {}, "Joints"), el("span", { class: "grow" }), usual),
      table,
    ),
  );
  /** @type {{slider: ReturnType<typeof weight>, moves: HTMLElement, shares: {set: (value: number | null) => void}[]}[]} */
  let rows = [];
  let built = "";
  store.on(["job", "scene", "selected", "plan", "connection"], draw);
  draw();

  /** @param {import("../axes.js").Axis[]} axes */
  function build(axes) {
    body.replaceChildren();
    table.classList.toggle(
      "named",
      axes.some(({ external }) => external),
    );
    units.textContent = [...new Set(axes.map(({ unit }) => unit))].join(", ");
    rows = axes.map(({ label, colour }, j) => {
      const slider = weight(j, (ratio, drag) => set(j, ratio, drag));
      const key = el("i", { class: "key" });
      key.style.background = `var(${colour})`;
      const [moves, shares] = [el("td"), [share(), share()]];
      body.append(
        el(
          "tr",
          {},
          el("th", { scope: "row", title: label }, el("label", { for: slider.id }, key, label)),
          el("td", {}, slider.element),
          moves,
          ...shares.map(({ element }) => element),
        ),
      );
      return { slider, moves, shares };
    });
  }

  /**
   * Send the weights with one of them changed.
   * @param {number} joint
   * @param {number} ratio  of its default weight
   * @param {string} drag
   */
  function set(joint, ratio, drag) {
    const base = store.job?.weights ?? [];
    const to = [.../** @type {number[]} */ (store.job?.values?.plan?.weights ?? base)];
    to[joint] = ratio * base[joint];
    send(
      to.map((each) => Number(each.toPrecision(4))),
      drag,
    );
  }

  function draw() {
    const { job, selected, scene } = store;
    const base = job?.weights ?? [];
    const axes = axesOf(scene?.robot);
    // The weights of a changed job arrive before its scene.
    host.hidden = !base.length || axes.length !== base.length;
    if (host.hidden) return;
    const key = JSON.stringify(axes);
    if (key !== built) build(axes);
    built = key;
    const disabled = store.connection !== "open" || !job?.values;
    const given = /** @type {number[] | null} */ (job?.values?.plan?.weights ?? null);
    usual.disabled = disabled || !given;
    const plans = (selected && store.plans.get(selected)) || [];
    const held = (selected && store.before.get(selected)) || [];
    table.classList.toggle(
      "stale",
      plans.some((plan) => store.stale(plan)),
    );
    rows.forEach(({ slider, moves, shares }, j) => {
      const { unit } = scene?.robot.joints[j] ?? { unit: "rad" };
      slider.show(
        given ? given[j] / base[j] : 1,
        `${digits((given ?? base)[j], 3)} per ${unit}`,
        disabled,
      );
      const [now, before] = [total(plans, j), total(held, j)].map(UNITS[unit].of);
      moves.replaceChildren(...(plans.length ? amount(now, before, axes[j].unit) : []));
      for (const [i, name] of /** @type {const} */ ([
        "peak_velocity",
        "peak_acceleration",
      ]).entries())
        shares[i].set(
          plans.length ? Math.max(...plans.map(({ criteria }) => criteria[name][j])) : null,
        );
    });
  }
}

/**
 * @param {PlanMessage[]} plans
 * @param {number} joint
 */
const total = (plans, joint) =>
  plans.reduce((sum, { criteria }) => sum + criteria.displacement[joint], 0);

/**
 * Return how far a joint moves, with an arrow where that is more or less than before.
 * @param {number} now  deg or mm
 * @param {number} before  the same, 0: not known
 * @param {string} unit
 */
function amount(now, before, unit) {
  const text = fixed(now, 1);
  if (!before || Math.abs(now - before) < 0.02 * before) return [text];
  const more = now > before;
  const said = `${more ? "more" : "less"} than before: ${fixed(before, 1)} ${unit}`;
  const arrow = el(
    "span",
    { class: more ? "up" : "down", title: said },
    more ? "\u25b4" : "\u25be",
  );
  return [text, arrow, el("span", { class: "unseen" }, said)];
}

/** Return a cell with a share of a limit, as a number and as a bar. */
function share() {
  const [number, bar] = [el("span"), el("i")];
  const element = el("td", {}, number, el("span", { class: "share" }, bar));
  return {
    element,
    /** @param {number | null} value */
    set(value) {
      number.textContent = value === null ? "" : fixed(100 * value, 0);
      bar.style.width = `${Math.min(100, 100 * (value ?? 0))}%`;
      bar.classList.toggle("high", (value ?? 0) > 0.9);
    },
  };
}
