/** The cost and proof of the chosen contour's plan, or the reason why there is none. */

import { byId, el, icon } from "../dom.js";
import { change, counted, deg, digits, fixed, millimetres, percent } from "../format.js";
import { standing } from "./contours.js";
import { noPath } from "./nopath.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../messages.js").PlanMessage} PlanMessage */

/**
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 * @param {{look: (view: string) => void}} view
 */
export function resultPanel(store, connection, view) {
  const [host, audit] = [byId("result"), byId("audit")];
  let open = false;
  let waiting = false;
  store.on(["plan", "selected", "job", "scene", "progress", "candidate"], () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw();
    });
  });
  draw();

  function draw() {
    const name = store.selected;
    const plans = (name && store.plans.get(name)) || [];
    const nopath = name ? store.nopaths.get(name) : undefined;
    audit.replaceChildren(...(plans.length ? [details(plans)] : []));
    if (!name) return host.replaceChildren();
    const { dot, words } = standing(store, name);
    const head = el(
      "header",
      {},
      el("h2", {}, name),
      el("span", { class: "grow" }),
      store.candidate?.contour === name
        ? el("span", { class: "badge warn" }, "a point of the Pareto set")
        : el("span", { class: `badge ${dot}` }, words),
    );
    host.dataset.revision = String(plans[0]?.revision ?? nopath?.revision ?? "");
    if (nopath)
      host.replaceChildren(
        el("section", { class: "card" }, head, ...noPath(nopath, connection, view)),
      );
    else if (!plans.length)
      host.replaceChildren(
        el(
          "section",
          { class: "card" },
          head,
          el(
            "p",
            { class: "quiet" },
            store.progress.busy
              ? "The first plan takes a few seconds, later ones a fraction of a second."
              : "Not planned. Plan again to see its motion.",
          ),
        ),
      );
    else {
      const section = el(
        "section",
        { class: "card result" },
        head,
        ...figures(plans),
        ...failures(plans),
      );
      section.classList.toggle(
        "stale",
        plans.some((plan) => store.stale(plan)),
      );
      host.replaceChildren(section);
    }
  }

  /** @param {PlanMessage[]} plans */
  function figures(plans) {
    const cost = plans.reduce((sum, plan) => sum + plan.cost, 0);
    const held = store.before.get(plans[0].contour) ?? [];
    const before = held.reduce((sum, plan) => sum + plan.cost, 0);
    const seconds = plans.reduce((sum, { time }) => sum + time[time.length - 1], 0);
    const changed = store.comparable(plans[0].contour) ? change(cost, before) : "";
    const worse = cost > before;
    return [
      el(
        "div",
        { class: "figures" },
        el(
          "div",
          {},
          el("span", { class: "label" }, "Cost"),
          el("b", { id: "cost" }, digits(cost, 4)),
          changed
            ? el(
                "span",
                { class: `delta ${changed === "same" ? "" : worse ? "up" : "down"}` },
                changed,
              )
            : null,
        ),
        el(
          "div",
          {},
          el("span", { class: "label" }, "Time of the cut"),
          el("b", {}, fixed(seconds, 2), el("small", {}, " s")),
        ),
      ),
      el("p", { class: "proof" }, ...proof(plans)),
    ];
  }

  /** @param {PlanMessage[]} plans */
  function proof(plans) {
    const gaps = plans.map(({ gap }) => gap);
    if (gaps.every((gap) => gap !== null)) {
      const most = Math.max(.../** @type {number[]} */ (gaps));
      return [
        icon("check"),
        `Proved: the best motion, at any gamma, posture and turn, saves at most ${percent(most, most < 0.01 ? 2 : 1)} of this cost.`,
      ];
    }
    if (plans.some(({ settled }) => !settled))
      return [el("i", { class: "dot busy" }), "The bound on the best cost is being computed."];
    return [
      plans.every(({ optimal }) => optimal)
        ? "Proved: the best motion on its grid."
        : "The best motion found; no bound on the best cost is proved.",
    ];
  }

  /** @param {PlanMessage[]} plans */
  function failures(plans) {
    const failed = plans.flatMap((plan) => plan.checks ?? []).filter(({ ok }) => !ok);
    return failed.map(({ title, value, limit, unit }) => {
      const is = value === null ? "" : `: ${inUnits(value, unit)}`;
      const most = limit === null ? "" : `, the limit is ${inUnits(limit, unit)}`;
      return el("p", { class: "fault" }, icon("warning"), ` ${title}${is}${most}`);
    });
  }

  /** @param {PlanMessage[]} plans */
  function details(plans) {
    const checks = plans.flatMap((plan) => plan.checks ?? []);
    const near = plans.flatMap(({ criteria }) => criteria.nearest);
    const row = (/** @type {string} */ name, /** @type {string} */ value, ok = true) =>
      el("tr", {}, el("th", { scope: "row" }, name), el("td", { class: ok ? "" : "fault" }, value));
    const shown = el(
      "details",
      { open, ontoggle: () => (open = shown.open) },
      el(
        "summary",
        {},
        checks.length ? `${counted(checks.length, "check")} of the audit, and margins` : "Margins",
      ),
      el(
        "table",
        { class: "figures-list" },
        el(
          "tbody",
          {},
          ...near.map(({ name, value, unit }) =>
            row(`nearest: ${name}`, value === null ? "none" : inUnits(value, unit)),
          ),
        ),
      ),
      el(
        "table",
        { class: "figures-list" },
        el(
          "tbody",
          {},
          ...checks.map(({ title, value, unit, ok }) =>
            row(title, value === null ? (ok ? "yes" : "no") : inUnits(value, unit), ok),
          ),
        ),
      ),
      el("p", { class: "quiet" }, plans[0].statement),
    );
    return el("section", { class: "card" }, shown);
  }
}

/**
 * Return an SI value in the units that are shown.
 * @param {number} value
 * @param {string} unit
 */
export function inUnits(value, unit) {
  if (unit === "rad") return `${fixed(deg(value), 1)} deg`;
  if (unit === "m")
    return Math.abs(value) < 1e-6 ? "0 mm" : millimetres(value, Math.abs(value) < 1e-3 ? 4 : 2);
  return `${digits(value, 3)}${unit ? ` ${unit}` : ""}`;
}
