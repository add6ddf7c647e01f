/** The search for the best placement: its ranges, the placements found, and taking one. */

import { el } from "../dom.js";
import { change, counted, digits, fixed } from "../format.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../messages.js").Try} Try */

/** The variables: label, unit, and default range on either side. */
const VARIABLES = /** @type {const} */ ({
  x_mm: ["Part x", "mm", 200],
  y_mm: ["Part y", "mm", 200],
  z_mm: ["Part z", "mm", 200],
  yaw_deg: ["Part about z", "deg", 30],
  tilt_x_deg: ["Part about x", "deg", 20],
  tilt_y_deg: ["Part about y", "deg", 20],
  base_x_mm: ["Robot base x", "mm", 200],
  base_y_mm: ["Robot base y", "mm", 200],
  base_z_mm: ["Robot base z", "mm", 200],
  base_yaw_deg: ["Robot base about z", "deg", 30],
  mount_deg: ["Head about flange", "deg", 90],
});
const USUAL = ["x_mm", "y_mm", "yaw_deg"];
const EVALUATIONS = 64;
/** @type {Record<string, {words: string, value: string}>} */
const GOALS = {
  speed: { words: "Fastest speed of the slowest contour", value: "m/min" },
  margin: { words: "Least ratio of fastest to requested speed", value: "times requested speed" },
  motion: { words: "Least displacement of the joints", value: "displacement" },
};

/**
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 * @param {import("../scene/placing.js").Placing} placing
 * @param {() => void} moved  called once another placement is shown
 */
export function candidates(store, connection, placing, moved) {
  /** @type {number | null} the one that is shown */
  let shown = null;
  let filled = false;
  /** @type {unknown[]} inputs of the last drawing of the list, which is only redrawn on changes */
  let drawnBefore = [];
  const goal = el(
    "select",
    { "aria-label": "Goal" },
    ...Object.entries(GOALS).map(([value, { words }]) => el("option", { value }, words)),
  );
  const judged = el(
    "select",
    { "aria-label": "Judged by", onchange: draw },
    el("option", { value: "grid" }, "Judged on the grid (faster)"),
    el("option", { value: "plans" }, "Judged by plans over continuous gamma"),
  );
  const evaluations = el("input", {
    ...{ class: "number", type: "number", min: 8, max: 100000, step: 8, value: EVALUATIONS },
    "aria-label": "Placements to try",
  });
  const rows = Object.entries(VARIABLES).map(([name, [label, unit, far]]) => {
    const end = (/** @type {string} */ which, /** @type {number} */ value) =>
      el("input", {
        ...{ class: "number", type: "number", step: "any", value, oninput: draw },
        "aria-label": `${label}, ${which}, ${unit}`,
      });
    const [low, high] = [end("least", -far), end("most", far)];
    const box = el("input", { type: "checkbox", checked: USUAL.includes(name), onchange: draw });
    const element = el(
      "div",
      { class: "vary" },
      el("label", {}, box, ` ${label}`),
      low,
      high,
      el("span", { class: "unit" }, unit),
    );
    return { name, box, low, high, element };
  });
  const start = el("button", { class: "plain", onclick: look });
  const bar = el("progress", { "aria-label": "Progress of the search" });
  const said = el("p", { class: "quiet small", "aria-live": "polite" });
  const list = el("div", { class: "list tries" });
  const actions = el("div", { class: "actions" });
  const element = el(
    "section",
    { class: "card" },
    el("header", {}, el("h3", {}, "Best placement"), el("span", { class: "grow" }), start),
    el("p", { class: "field" }, goal),
    el("p", { class: "field" }, judged),
    el(
      "details",
      { class: "group-of-keys" },
      el("summary", {}, "Variables and ranges"),
      ...rows.map((row) => row.element),
      el("p", { class: "field head" }, el("span", {}, "Placements to try "), evaluations),
    ),
    bar,
    said,
    list,
    actions,
  );
  return { element, draw, forget: () => (shown = null) };

  function running() {
    return store.layout?.state === "running" && !store.stale(store.layout);
  }

  /** The requested ranges; null if there is none, or one is invalid. */
  function ranges() {
    const wanted = rows.filter(({ box }) => box.checked);
    const spans = wanted.map(({ name, low, high }) => [
      name,
      [low, high].map(({ value }) => value),
    ]);
    const bad = spans.some(([, [low, high]]) => !low || !high || !(Number(low) < Number(high)));
    if (!wanted.length || bad) return null;
    return Object.fromEntries(
      wanted.map(({ name, low, high }) => [name, [Number(low.value), Number(high.value)]]),
    );
  }

  function look() {
    if (running()) return void connection.send({ type: "cancel" });
    const spans = ranges();
    if (!spans) return;
    shown = null;
    placing.reset();
    moved();
    const count = Math.min(100000, Math.max(8, Math.round(Number(evaluations.value)) || 64));
    connection.send({
      ...{ type: "layout", goal: goal.value, ranges: spans, evaluations: count },
      grid: judged.value === "grid",
    });
  }

  /** Take the settings of [layout] from the job, once. */
  function fill() {
    const table = store.job?.values?.layout;
    if (filled || !table) return;
    filled = true;
    goal.value = table.goal;
    if (store.job?.given.includes("layout.evaluations")) evaluations.value = table.evaluations;
    if (!rows.some(({ name }) => table[name])) return;
    for (const { name, box, low, high } of rows) {
      box.checked = Boolean(table[name]);
      if (table[name]) [low.value, high.value] = table[name].map(String);
    }
  }

  /** @param {Try} tried */
  function show(tried) {
    shown = tried.number;
    placing.preview(tried);
    moved();
  }

  function back() {
    shown = null;
    placing.reset();
    moved();
  }

  function draw() {
    fill();
    const { layout, job } = store;
    const planned = store.outcome?.revision === job?.revision;
    const live = store.connection === "open" && Boolean(job?.values);
    judged.hidden = job?.values?.plan?.method !== "continuous";
    start.textContent = running() ? "Stop" : layout ? "Search again" : "Search";
    start.disabled = !live || (!running() && (!planned || !ranges()));
    bar.hidden = !running();
    if (layout?.total) bar.value = layout.done / layout.total;
    else bar.removeAttribute("value");
    const stale = layout !== null && store.stale(layout);
    if (stale || !placing.moved) shown = null;
    say(stale);
    const drawn = [layout, shown, stale, live];
    if (drawn.every((each, i) => each === drawnBefore[i])) return;
    drawnBefore = drawn;
    const tries = layout?.best ?? [];
    const focused = /** @type {HTMLElement | null} */ (document.activeElement)?.dataset?.number;
    list.classList.toggle("stale-set", stale);
    list.replaceChildren(...tries.map((each) => entry(each, stale || !live)));
    if (focused !== undefined && list.isConnected)
      [...list.querySelectorAll("button")].find((b) => b.dataset.number === focused)?.focus();
    const chosen = tries.find(({ number }) => number === shown);
    actions.replaceChildren(...(chosen ? taking(chosen, live) : []));
  }

  /** @param {boolean} stale */
  function say(stale) {
    const { layout } = store;
    const words = !layout
      ? "Searches for the best placement around the current one. It takes from seconds to many minutes; a change of the job stops it."
      : stale
        ? "Out of date: the job has changed. Search again for the current job."
        : running()
          ? `${layout.label}: ${layout.total ? `${layout.done} of ${layout.total}` : "under way"}. ${counted(layout.tried, "placement")} tried.`
          : `${counted(layout.tried, "placement")} tried, ${layout.feasible} feasible${layout.state === "stopped" ? "; stopped" : ""}. ${layout.said}${layout.grid ? " Values are for the grid; plans over continuous gamma may be faster." : ""}`;
    if (said.textContent !== words) said.textContent = words;
  }

  /**
   * @param {Try} tried
   * @param {boolean} disabled
   */
  function entry(tried, disabled) {
    const { number, offsets, value, bound, estimate, status, reason } = tried;
    const unit = GOALS[store.layout?.goal ?? "speed"].value;
    const most = store.layout?.goal === "motion" ? "at least" : "at most";
    const own = (store.layout?.best ?? []).find(isOwn)?.value ?? null;
    const gain = value !== null && own !== null && !isOwn(tried) ? `, ${change(value, own)}` : "";
    const words =
      value !== null
        ? `${digits(value, 3)} ${unit}${gain}`
        : status !== "feasible"
          ? { unreachable: "out of reach", collision: "collides", speed: "no path" }[status]
          : bound !== null
            ? `${most} ${digits(bound, 3)} ${unit}`
            : estimate !== null
              ? `about ${digits(estimate, 3)} ${unit}`
              : "within reach";
    return el(
      "button",
      {
        ...{ "data-number": number, "aria-current": String(number === shown), disabled },
        title: reason ?? null,
        onclick: () => show(tried),
      },
      el("i", { class: `dot ${status !== "feasible" ? "none" : value !== null ? "done" : ""}` }),
      el("span", { class: "name" }, words),
      el("span", { class: "more" }, isOwn(tried) ? "placement of the job" : moves(offsets)),
    );
  }

  /**
   * @param {Try} tried
   * @param {boolean} live
   */
  function taking(tried, live) {
    const take = () => {
      placing.sent(connection.send({ type: "take", number: tried.number }));
    };
    const disabled = !live || tried.status !== "feasible";
    return [
      el("button", { class: "primary", disabled, onclick: take }, "Take it"),
      el("button", { class: "plain", onclick: back }, "Back to the job's place"),
      ...(tried.reason ? [el("p", { class: "fault" }, tried.reason)] : []),
    ];
  }
}

/** @param {Try} tried */
const isOwn = ({ offsets }) => Object.values(offsets).every((each) => each === 0);

/** @param {Record<string, number>} offsets */
function moves(offsets) {
  return Object.entries(offsets)
    .filter(([, value]) => value !== 0)
    .map(([name, value]) => {
      const [label, unit] = VARIABLES[/** @type {keyof typeof VARIABLES} */ (name)];
      return `${label} ${value > 0 ? "+" : ""}${fixed(value, 1)} ${unit}`;
    })
    .join(", ");
}
