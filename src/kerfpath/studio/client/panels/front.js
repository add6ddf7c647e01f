/** The Pareto set of the chosen contour: its points, whose motions can be shown and taken. */

import { byId, el } from "../dom.js";
import { UNITS, digits } from "../format.js";
import { SCALE_GRADIENT } from "../scene/scale.js";
import { Scatter } from "../scatter.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../messages.js").FrontPoint} FrontPoint */

const USUAL = ["displacement", "velocity", "range"];
const MOST = 5; // criteria of one set

/**
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 */
export function frontPanel(store, connection) {
  const host = byId("front");
  const wanted = new Set(USUAL);
  const canvas = el("canvas", { tabindex: 0, class: "scatter" });
  const scatter = new Scatter(canvas);
  const said = el("p", { class: "quiet small", "aria-live": "polite" });
  const start = el("button", { class: "plain", onclick: look });
  const runs = el("input", {
    ...{ class: "number", type: "number", min: 10, max: 1000, step: 10, value: 100 },
    "aria-label": "Runs of the planner",
  });
  const bar = el("progress", { max: 1, value: 0, "aria-label": "Progress of the Pareto set" });
  const boxes = el("div", { class: "criteria", role: "group", "aria-label": "Criteria" });
  const pickers = ["across", "up", "by colour"].map((name, i) => {
    const select = el("select", {
      "aria-label": `Criterion ${name}`,
      onchange: () => {
        scatter.shown[i] = Number(select.value);
        draw();
      },
    });
    return select;
  });
  const ramp = el("i", { class: "ramp" });
  ramp.style.background = SCALE_GRADIENT;
  const [low, high] = [el("span"), el("span")];
  const scale = el("p", { class: "quiet small" }, low, ramp, high);
  const found = el(
    "div",
    {},
    el("div", { class: "pickers" }, ...pickers),
    el("div", { class: "scatter-box" }, canvas),
    scale,
    said,
  );
  const actions = el("div", { class: "actions" });
  const fold = el(
    "details",
    { class: "group-of-keys" },
    el("summary", {}, "Criteria and runs"),
    boxes,
    el("p", { class: "field head" }, el("label", {}, "Runs of the planner "), runs),
  );
  host.replaceChildren(
    el(
      "section",
      { class: "card" },
      el("header", {}, el("h2", {}, "Pareto set"), el("span", { class: "grow" }), start),
      bar,
      found,
      actions,
      fold,
    ),
  );
  store.on(["front", "candidate", "selected", "job", "plan", "connection"], draw);
  new ResizeObserver(() => scatter.draw()).observe(canvas);
  canvas.addEventListener("pointermove", ({ offsetX, offsetY }) =>
    hover(scatter.at(offsetX, offsetY)?.number ?? null),
  );
  canvas.addEventListener("pointerleave", () => hover(null));
  canvas.addEventListener("click", ({ offsetX, offsetY }) => {
    const point = scatter.at(offsetX, offsetY);
    if (point) show(point.number);
  });
  canvas.addEventListener("keydown", key);
  draw();
  return { paint: draw };

  /** The set of the chosen contour, or null. */
  function mine() {
    return store.front?.contour === store.selected ? store.front : null;
  }

  function running() {
    return store.front?.state === "running" && !store.stale(store.front);
  }

  function look() {
    if (running()) return void connection.send({ type: "cancel" });
    const count = Math.min(1000, Math.max(10, Math.round(Number(runs.value)) || 100));
    store.withdraw();
    connection.send({
      type: "front",
      contour: store.selected,
      criteria: [...wanted],
      runs: count,
    });
  }

  /** @param {number} number */
  function show(number) {
    const front = mine();
    if (front && !store.stale(front))
      connection.send({ type: "point", contour: front.contour, number });
  }

  /** @param {number | null} number */
  function hover(number) {
    if (number === scatter.hover) return;
    scatter.hover = number;
    canvas.style.cursor = number === null ? "" : "pointer";
    scatter.draw();
    say();
  }

  /** @param {KeyboardEvent} event */
  function key(event) {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const best = scatter.points.filter((point) => point.best);
    best.sort((a, b) => a.values[scatter.shown[0]] - b.values[scatter.shown[0]]);
    if (event.key === "Enter" && scatter.hover !== null) show(scatter.hover);
    if (!by || !best.length) return;
    const at = best.findIndex(({ number }) => number === (scatter.hover ?? scatter.chosen));
    hover(best[Math.min(Math.max(at + by, 0), best.length - 1)].number);
    event.preventDefault();
    event.stopPropagation();
  }

  /**
   * @param {number} i
   * @returns {{label: string, unit: string, of: (value: number) => number, words: string}}
   */
  function axis(i) {
    const { words, unit, better } = /** @type {import("../messages.js").FrontMessage} */ (
      store.front
    ).axes[i];
    const known = UNITS[unit] ?? { unit, of: (/** @type {number} */ value) => value };
    return {
      ...known,
      words,
      label: `${words}, ${known.unit} ${better === "less" ? "\u2193" : "\u2191"}`,
    };
  }

  function draw() {
    const { job, candidate } = store;
    const front = mine();
    const live = store.connection === "open" && Boolean(job?.values);
    const planned = store.plans.has(store.selected ?? "");
    host.hidden = !job;
    start.textContent = running() ? "Stop" : front ? "Search again" : "Search";
    start.disabled = !live || !planned || wanted.size < 2;
    bar.hidden = !running();
    bar.value = store.front ? store.front.done / store.front.total : 0;
    const stale = front !== null && store.stale(front);
    found.hidden = !front;
    found.classList.toggle("stale-set", stale);
    criteria();
    if (front) {
      scatter.shown = /** @type {[number, number, number]} */ (
        scatter.shown.map((each, i) =>
          each < front.axes.length ? each : i < 2 ? i % front.axes.length : -1,
        )
      );
      choices(front.axes.length);
      const scaled = front.axes.map((_, i) => axis(i).of);
      scatter.points = front.points.map(({ number, values, best }) => ({
        ...{ number, best },
        values: values.map((value, i) => scaled[i](value)),
      }));
      scatter.axes = [axis(scatter.shown[0]), axis(scatter.shown[1])];
      scatter.chosen = candidate?.contour === front.contour ? candidate.number : null;
      const by = scatter.shown[2];
      scale.hidden = by < 0 || !scatter.points.length;
      if (!scale.hidden) {
        const ends = scatter.range(by).map((value) => digits(value, 3));
        low.textContent = `${ends[0]} `;
        high.textContent = ` ${ends[1]} ${axis(by).unit}`;
      }
      const best = front.points.filter((point) => point.best).length;
      canvas.setAttribute(
        "aria-label",
        `${best} non-dominated plans; arrow keys go from one to the next, Enter shows its motion`,
      );
      scatter.draw();
    }
    say();
    actions.replaceChildren(...taking(live));
  }

  /** Let the criteria be chosen. */
  function criteria() {
    const words = store.job?.choices["pareto.criteria"] ?? [];
    const shown = [...words, ...wanted].join(" ");
    if (boxes.dataset.shown === shown) return;
    boxes.dataset.shown = shown;
    const focused = document.activeElement?.getAttribute("data-criterion");
    boxes.replaceChildren(
      ...words.map((word) => {
        const box = el("input", {
          ...{ type: "checkbox", checked: wanted.has(word), "data-criterion": word },
          disabled: !wanted.has(word) && wanted.size >= MOST,
          onchange: () => {
            if (box.checked) wanted.add(word);
            else wanted.delete(word);
            draw();
          },
        });
        return el("label", {}, box, ` ${word}`);
      }),
    );
    if (focused)
      /** @type {HTMLElement | null} */ (
        boxes.querySelector(`[data-criterion="${focused}"]`)
      )?.focus();
  }

  /** @param {number} count */
  function choices(count) {
    const names = Array.from({ length: count }, (_, i) => store.front?.axes[i].name ?? "");
    pickers.forEach((select, i) => {
      const all = [...(i === 2 ? [["-1", "one colour"]] : []), ...names.map((n, j) => [`${j}`, n])];
      const shown = names.join();
      if (select.dataset.shown !== shown) {
        select.dataset.shown = shown;
        select.replaceChildren(...all.map(([value, text]) => el("option", { value }, text)));
      }
      select.value = String(scatter.shown[i]);
    });
  }

  /** Show the values of the point under the pointer, or the state of the search. */
  function say() {
    const front = mine();
    if (!front) return;
    const number = scatter.hover ?? scatter.chosen;
    const point = scatter.points.find((each) => each.number === number);
    if (point)
      return void (said.textContent = point.values
        .map((value, i) => `${axis(i).words} ${digits(value, 3)} ${axis(i).unit}`)
        .join(", "));
    const best = front.points.filter((each) => each.best).length;
    said.textContent = store.stale(front)
      ? "Out of date: the job has changed. Search again for the current job."
      : front.state === "running"
        ? `${front.done} of ${front.total} runs, ${best} non-dominated plans.`
        : `${best} non-dominated plans, from ${front.done} runs${front.state === "stopped" ? "; stopped" : ""}. Click a plan to see its motion. The arrow of a criterion points in the better direction.`;
  }

  /** @param {boolean} live */
  function taking(live) {
    const { candidate } = store;
    const front = mine();
    const point = front?.points.find(({ number }) => number === candidate?.number);
    if (!front || !point || candidate?.contour !== front.contour) return [];
    const { edits } = point;
    const back = el(
      "button",
      { class: "plain", onclick: () => store.withdraw() },
      "Back to the job's plan",
    );
    if (!edits)
      return [
        back,
        el(
          "p",
          { class: "quiet small" },
          "This plan was restricted by windows of joints or by a clearance, for which a job has no keys. kerfpath pareto --pick writes its program.",
        ),
      ];
    const take = () => connection.send({ type: "edits", edits });
    return [
      el("button", { class: "primary", disabled: !live, onclick: take }, "Take it"),
      back,
      el(
        "p",
        { class: "quiet small" },
        "Taking it sets weights, limits, metric, objective and method for every contour.",
      ),
    ];
  }
}
