/** Two plans side by side: a kept plan, and the plan that is shown now. */

import { axesOf } from "../axes.js";
import { byId, el, icon } from "../dom.js";
import { jointsAt } from "../kinematics.js";
import { OF_JOINT, body, jointRows, rows } from "./differences.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../messages.js").PlanMessage} PlanMessage */
/** @typedef {import("../messages.js").KeptEntry} KeptEntry */

/**
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 * @param {import("../player.js").Player} player
 * @param {{accompany: (q: ArrayLike<number> | null) => void}} view
 */
export function comparePanel(store, connection, player, view) {
  const host = byId("compare");
  /** @type {number | null} the one that is compared, also while its plans are being fetched */
  let chosen = null;
  let keeping = false;
  let ghost = true;
  let open = false;
  let waiting = false;
  /** @type {import("./differences.js").OfJoint} */
  let kind = "displacement";
  const keep = el(
    "button",
    { class: "plain", title: "Keep the current job and its plans", onclick: take },
    icon("keep"),
    "Keep to compare",
  );
  const list = el("div", { class: "kept", role: "group", "aria-label": "Kept plans" });
  const shown = el("div", {});
  host.replaceChildren(
    el(
      "section",
      { class: "card" },
      el("header", {}, el("h2", {}, "Compare"), el("span", { class: "grow" }), keep),
      list,
      shown,
    ),
  );
  store.on(["kept"], heard);
  store.on(["error"], ({ about }) => about === "keep" && (keeping = false));
  store.on(["kept", "compare", "plan", "selected", "job", "connection", "outcome"], invalidate);
  store.on(["compare", "selected"], follow);
  player.on(follow);
  draw();

  function invalidate() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw();
    });
  }

  function take() {
    keeping = connection.send({ type: "keep" });
  }

  /** Take the list of kept plans: compare with one just kept here, and drop one that is gone. */
  function heard() {
    const entry = store.kept.find(({ id }) => id === chosen);
    if (keeping && store.kept.length) choose(store.kept[store.kept.length - 1]);
    else if (chosen !== null && !entry) choose(null);
    else if (entry && store.against?.entry.settled !== entry.settled) choose(entry);
    else if (entry && store.against) store.compareWith({ ...store.against, entry });
    keeping = false;
  }

  /** @param {KeptEntry | null} entry */
  async function choose(entry) {
    chosen = entry?.id ?? null;
    if (!entry) return store.compareWith(null);
    const answer = await fetch(`kept/${entry.id}${location.search}`);
    const newest = store.kept.find(({ id }) => id === entry.id);
    if (chosen !== entry.id || !answer.ok || !newest) return;
    /** @type {Map<string, PlanMessage[]>} */
    const plans = new Map();
    for (const plan of /** @type {PlanMessage[]} */ (await answer.json()))
      plans.set(plan.contour, [...(plans.get(plan.contour) ?? []), plan]);
    for (const pieces of plans.values()) pieces.sort((a, b) => a.s[0] - b.s[0]);
    if (chosen === entry.id) store.compareWith({ entry: newest, plans });
  }

  /** Show the robot of the other plan at the same path length. */
  function follow() {
    const { moment } = player;
    const plan = moment?.span.plan;
    const others = (ghost && plan && store.compared(plan.contour)) || [];
    if (!plan || !moment || !others.length) return view.accompany(null);
    const [s] = jointsAt(plan.time, plan.s, 1, moment.local);
    const other = others.find((each) => s <= each.s[each.s.length - 1]) ?? others.at(-1);
    if (!other) return;
    view.accompany(jointsAt(other.s, other.q, other.weights.length, s));
  }

  function draw() {
    const live = store.connection === "open";
    host.hidden = !store.job;
    keep.disabled = !live || !store.plans.size || !store.job?.values;
    list.hidden = !store.kept.length;
    const focused = host.contains(document.activeElement)
      ? document.activeElement?.getAttribute("data-key")
      : null;
    list.replaceChildren(
      ...store.kept.map((entry) =>
        el(
          "button",
          {
            "data-key": `kept ${entry.id}`,
            "aria-pressed": String(entry.id === chosen),
            title: entry.id === chosen ? "Compare with none" : `Compare with ${entry.name}`,
            onclick: () => choose(entry.id === chosen ? null : entry),
          },
          entry.name,
        ),
      ),
      ...(store.against ? naming(store.against.entry, live) : []),
    );
    const { against } = store;
    shown.replaceChildren(...(against ? compared(against, live) : []));
    if (focused)
      /** @type {HTMLElement | null} */ (host.querySelector(`[data-key="${focused}"]`))?.focus();
  }

  /**
   * @param {import("../store.js").Against} against
   * @param {boolean} live
   */
  function compared({ entry, plans }, live) {
    const { id, name } = entry;
    const then = store.compared(store.selected ?? "");
    const now = store.plans.get(store.selected ?? "") ?? [];
    const both = then.length > 0 && now.length > 0;
    const told = then.length
      ? now.length
        ? ""
        : `This contour has no plan now; ${name} has one.`
      : plans.has(store.selected ?? "")
        ? `The robot of ${name} has other joints or external axes.`
        : `${name} has no plan for this contour.`;
    return [
      both ? figures(entry, then, now) : el("p", { class: "quiet small" }, told),
      both ? byJoint(entry, then, now) : null,
      el(
        "div",
        { class: "actions" },
        action("restore", "Restore this job, as one step of undo", `Go back to ${name}`, () =>
          connection.send({ type: "restore", id }),
        ),
        both
          ? el(
              "button",
              {
                ...{ class: "text", "data-key": "ghost", "aria-pressed": String(ghost) },
                title: "Show its robot in the scene, at the same path length",
                onclick: haunt,
              },
              "Show its robot",
            )
          : null,
      ),
    ].filter((each) => each !== null);

    /**
     * @param {string} key
     * @param {string} title
     * @param {string} words
     * @param {() => void} act
     */
    function action(key, title, words, act) {
      const attributes = { class: "plain", "data-key": key, title, disabled: !live, onclick: act };
      return el("button", attributes, words);
    }
  }

  function haunt() {
    ghost = !ghost;
    follow();
    draw();
  }

  /**
   * @param {KeptEntry} entry
   * @param {boolean} live
   */
  function naming({ id, name }, live) {
    const input = el("input", {
      ...{ class: "name", "data-key": "name", value: name, maxlength: 40, disabled: !live },
      "aria-label": "Name of the kept plan",
      onchange: () =>
        input.value.trim() && connection.send({ type: "rename", id, name: input.value.trim() }),
      onkeydown: (/** @type {KeyboardEvent} */ event) => event.key === "Enter" && input.blur(),
    });
    const forget = el(
      "button",
      {
        ...{ class: "tool", "data-key": "forget", disabled: !live },
        ...{ title: `Forget ${name}`, "aria-label": `Forget ${name}` },
        onclick: () => connection.send({ type: "forget", id }),
      },
      icon("close"),
    );
    return [el("span", { class: "grow" }), input, forget];
  }

  /** @param {string} name */
  const columns = (name) =>
    el(
      "thead",
      {},
      el(
        "tr",
        {},
        el("td", {}),
        ...[name, "now", "difference"].map((each) => el("th", { scope: "col" }, each)),
      ),
    );

  /**
   * @param {KeptEntry} entry
   * @param {PlanMessage[]} then
   * @param {PlanMessage[]} now
   */
  function figures(entry, then, now) {
    const { metric, objective } = store.job?.values?.plan ?? {};
    const weights = (/** @type {PlanMessage[]} */ plans) =>
      plans[0].weights.map((each) => each.toPrecision(6)).join(" ");
    const alike =
      entry.metric === metric && entry.objective === objective && weights(then) === weights(now);
    const { outcome } = store;
    const known = outcome && !store.stale(outcome) ? (outcome.cycle?.total ?? null) : null;
    const found = rows(then, now, {
      ...{ alike, cycle: [entry.cycle?.total ?? null, known] },
      axes: axesOf(store.scene?.robot),
    });
    return el(
      "div",
      {},
      el("table", { class: "compared" }, columns(entry.name), body(found)),
      alike
        ? null
        : el(
            "p",
            { class: "quiet small" },
            "Their costs cannot be compared: weights, metric or objective differ.",
          ),
    );
  }

  /**
   * @param {KeptEntry} entry
   * @param {PlanMessage[]} then
   * @param {PlanMessage[]} now
   */
  function byJoint(entry, then, now) {
    const pick = (/** @type {string} */ each) => {
      kind = /** @type {import("./differences.js").OfJoint} */ (each);
      draw();
    };
    const tabs = Object.entries(OF_JOINT).map(([each, title]) =>
      el(
        "button",
        {
          "data-key": `of ${each}`,
          "aria-pressed": String(each === kind),
          onclick: () => pick(each),
        },
        title,
      ),
    );
    const fold = el(
      "details",
      { open, ontoggle: () => (open = fold.open) },
      el("summary", { "data-key": "by joint" }, "Joint by joint"),
      el("div", { class: "segments", role: "group", "aria-label": "Criterion" }, ...tabs),
      el(
        "table",
        { class: "compared" },
        columns(entry.name),
        body(jointRows(then, now, kind, axesOf(store.scene?.robot))),
      ),
    );
    return fold;
  }
}
