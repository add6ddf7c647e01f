/** The placement of the part: moved by numbers or handles, with its reach and fastest speed. */

import { byId, el, icon } from "../dom.js";
import { change, counted, fixed } from "../format.js";
import { candidates } from "./candidates.js";
import { sheetShown, showSheet } from "./sheet.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../scene/placing.js").What} What */

const PATIENCE = 2000; // ms to wait for an answer
const AXES = ["x", "y", "z"];
const TURNS = ["roll", "pitch", "yaw"];

/**
 * @param {Store} store
 * @param {{send: (message: any) => boolean}} connection
 * @param {import("../scene/view.js").SceneView} view
 */
export function layoutSheet(store, connection, view) {
  const { placing } = view;
  const opener = byId("open-layout", HTMLButtonElement);
  opener.append(icon("move"), "Layout");
  let [asked, waiting, again] = [0, 0, false]; // the number of the last question, whether it is open
  let [turns, revision] = [false, 0];
  let [looked, looking] = ["", false]; // for which job and contour the fastest speed was asked for
  /** @type {Map<string, {place: string, now: number | null, before: number | null}>} by contour */
  const speeds = new Map();

  const what = segments("Body to move", { part: "Part", robot: "Robot" }, (value) => {
    placing.choose(/** @type {What} */ (value), turns);
    draw();
  });
  const how = segments("How", { move: "Move", turn: "Turn" }, (value) => {
    turns = value === "turn";
    placing.choose(placing.what, turns);
    draw();
  });
  const xyz = AXES.map((axis) => number(`Part ${axis}`, axis, "mm", 10, putPart));
  const rpy = TURNS.map((turn) => number(`Part ${turn}`, turn, "deg", 1, putPart));
  const base = AXES.map((axis) => number(`Robot base ${axis}, by`, axis, "mm", 10, putRobot));
  const yaw = number("Robot base turned by", "yaw", "deg", 1, putRobot);
  const mount = number("Head turned by", "head", "deg", 5, putRobot);
  const all = [...xyz, ...rpy, ...base, yaw, mount];
  const reach = el("div", { class: "reach", "aria-live": "polite" });
  const speed = el("div", { "aria-live": "polite" });
  const robot = el(
    "details",
    { class: "group-of-keys" },
    el("summary", {}, "Robot and head, moved by"),
    grid([...base, yaw, mount]),
    el(
      "p",
      { class: "quiet small" },
      "The job is written in the robot's base: if the base moves, all else moves the other way.",
    ),
  );
  const search = candidates(store, connection, placing, moved);
  const body = el(
    "div",
    { class: "cards" },
    card(
      "Position",
      el("div", { class: "pair" }, what.element, how.element),
      grid([...xyz, ...rpy]),
      robot,
    ),
    card("Reach", reach),
    card("Fastest speed", speed),
    search.element,
  );

  opener.addEventListener("click", () => {
    showSheet("layout", "Layout", [], [body], true);
    revision = store.job?.revision ?? 0;
    placing.show(true);
    placing.choose(placing.what, turns);
    draw();
    ask();
    xyz[0].input.focus();
  });
  byId("sheet").addEventListener("close", leave);
  placing.on((done) => {
    search.forget();
    if (done) commit();
    else moved();
  });
  store.on(["job"], () => {
    if (!placing.open || store.job?.revision === revision) return;
    revision = store.job?.revision ?? 0;
    if (!placing.awaits) placing.reset();
    placing.awaits = false;
    ask();
  });
  store.on(["scene"], ask);
  store.on(["reach"], heard);
  store.on(["error"], ({ about }) => {
    if (about === "place" || about === "take") placing.reset();
    if (about === "reach") waiting = 0;
    if (about === "fastest") found(null);
  });
  store.on(["fastest"], ({ contour, revision: of, speed_m_min: now }) => {
    if (of === store.job?.revision && contour === store.selected) found(now);
  });
  store.on(["connection"], () => (waiting = 0));
  store.on(["job", "scene", "connection", "selected", "progress", "outcome", "layout"], () => {
    opener.disabled = store.connection !== "open" || !store.scene?.contours.length;
    if (sheetShown() !== "layout") leave();
    else draw();
  });

  function leave() {
    if (!placing.open || (byId("sheet", HTMLDialogElement).open && sheetShown() === "layout"))
      return;
    placing.show(false);
  }

  /** Show the new placement, and ask for its reach. */
  function moved() {
    draw();
    ask();
  }

  /** Write the move to the job, as one step of undo. */
  function commit() {
    const offsets = placing.offsets();
    if (Object.keys(offsets).length)
      placing.sent(connection.send({ type: "place", scene: store.scene?.revision, offsets }));
    moved();
  }

  /** Ask for the reach; if an answer is awaited, ask again after it. */
  function ask() {
    if (!placing.open || store.connection !== "open") return;
    if (waiting && performance.now() - waiting < PATIENCE) return void (again = true);
    again = false;
    waiting = performance.now();
    connection.send({ type: "reach", offsets: placing.offsets(), number: ++asked });
  }

  function heard() {
    const { reach: answer } = store;
    if (!answer || answer.number !== asked) return;
    waiting = 0;
    if (!placing.open) return;
    if (answer.revision === store.scene?.revision) placing.take(answer);
    draw();
    if (again) ask();
  }

  function putPart() {
    search.forget();
    placing.put(
      xyz.map(({ input }) => Number(input.value)),
      rpy.map(({ input }) => Number(input.value)),
    );
    moved();
  }

  function putRobot() {
    search.forget();
    placing.moveRobot(
      base.map(({ input }) => Number(input.value)),
      Number(yaw.input.value),
      Number(mount.input.value),
    );
    moved();
  }

  function draw() {
    if (!placing.open) return;
    const live = store.connection === "open" && Boolean(store.job?.values);
    for (const { input } of all) input.disabled = !live;
    what.show(placing.what);
    how.show(turns ? "turn" : "move");
    const offsets = placing.offsets();
    const { place } = placing;
    xyz.forEach((each, i) => each.show(place?.xyz[i] ?? 0, 2));
    rpy.forEach((each, i) => each.show(place?.rpy[i] ?? 0, 3));
    AXES.forEach((axis, i) => base[i].show(offsets[`base_${axis}_mm`] ?? 0, 2));
    yaw.show(offsets.base_yaw_deg ?? 0, 3);
    mount.show(offsets.mount_deg ?? 0, 3);
    drawReach();
    drawSpeed();
    search.draw();
  }

  function drawReach() {
    const contours = placing.reach?.contours ?? [];
    const lost = contours.filter(({ out }) => out.length);
    const count = lost.reduce((sum, { out }) => sum + out.length, 0);
    const nodes = contours.reduce((sum, each) => sum + each.nodes, 0);
    const words = !placing.reach
      ? "Testing what the robot reaches."
      : count
        ? `Out of reach: ${count} of ${counted(nodes, "node")}, on ${lost.length} of ${counted(contours.length, "contour")}.`
        : `All ${counted(nodes, "node")} of ${counted(contours.length, "contour")} are within reach.`;
    const stroke = (/** @type {string} */ kind) => el("i", { class: `stroke ${kind}` });
    const said = el("p", { class: count ? "fault" : "" }, stroke(count ? "lost" : "here"), words);
    if (reach.textContent === words + lost.map(where).join("") && reach.childElementCount) return;
    reach.replaceChildren(
      said,
      ...(lost.length
        ? [el("ul", { class: "quiet small" }, ...lost.map((each) => el("li", {}, where(each))))]
        : []),
    );
  }

  /** @param {{name: string, nodes: number, out: number[]}} contour */
  function where({ name, nodes, out }) {
    return `${name}: ${out.length === nodes ? "all of it" : `${out.length} of ${counted(nodes, "node")}`}`;
  }

  /** Show the fastest speed of the chosen contour; search for it once the server is idle. */
  function drawSpeed() {
    const { selected, job, outcome, progress } = store;
    if (!selected || !job) return;
    const key = `${job.revision} ${selected}`;
    const known = speeds.get(selected);
    const here = known?.place === placeNow();
    const out = placing.reach?.contours.find(({ name }) => name === selected)?.out.length ?? 0;
    const settled = !progress.busy && outcome?.revision === job.revision && !job.faults.length;
    const idle = settled && !placing.moved && store.layout?.state !== "running";
    if (looking && !progress.busy && looked !== key) looking = false;
    if (idle && placing.reach && !out && looked !== key && !here) find(key);
    const row = (/** @type {string} */ name, /** @type {number | null | undefined} */ value) =>
      el("dd", {}, value === undefined || value === null ? name : `${fixed(value, 2)} m/min`);
    const was = here && !placing.moved ? known?.before : known?.now;
    const gain =
      here && !placing.moved && known?.now && was
        ? el("span", { class: "quiet" }, ` ${change(known.now, was)}`)
        : "";
    const state = placing.moved
      ? "once the move is in the job"
      : out
        ? "none: nodes are out of reach"
        : looking
          ? "searching"
          : here
            ? "none was found"
            : idle
              ? "not searched for"
              : "once all contours are planned";
    const now = row(state, here && !out && !placing.moved ? known?.now : null);
    now.append(gain);
    const offer = looking ? "stop" : idle && !here && !out && looked === key ? "look" : "";
    const drawn = [selected, now.textContent, was, offer].join();
    if (speed.dataset.drawn === drawn) return;
    speed.dataset.drawn = drawn;
    speed.replaceChildren(
      el("p", { class: "quiet small" }, `Constant speed along ${selected}.`),
      el(
        "dl",
        { class: "facts" },
        el("dt", {}, "here"),
        now,
        el("dt", {}, "before"),
        row("–", was),
      ),
      ...(offer === "stop"
        ? [el("button", { class: "text", onclick: () => stop() }, "Stop the search")]
        : offer
          ? [el("button", { class: "text", onclick: () => find(key) }, "Find the fastest")]
          : []),
    );
  }

  /** @param {string} key */
  function find(key) {
    looked = key;
    looking = connection.send({ type: "fastest", contour: store.selected });
  }

  function stop() {
    looking = false;
    connection.send({ type: "cancel" });
    draw();
  }

  /** @param {number | null} now  m/min */
  function found(now) {
    const { selected } = store;
    if (!selected || (!looking && now === null)) return;
    looking = false;
    const [known, place] = [speeds.get(selected), placeNow()];
    const before = known?.place === place ? known.before : (known?.now ?? null);
    speeds.set(selected, { place, now, before });
    draw();
  }

  /** A key for the place of part and tip. */
  function placeNow() {
    return JSON.stringify([store.scene?.T_part, store.scene?.robot.T_tool]);
  }

  /**
   * @param {string} label
   * @param {string} short
   * @param {string} unit
   * @param {number} step
   * @param {() => void} put
   */
  function number(label, short, unit, step, put) {
    /** @type {HTMLInputElement} */
    const input = el("input", {
      ...{ class: "number", type: "number", step, inputmode: "decimal" },
      "aria-label": `${label}, ${unit}`,
      oninput: () => input.value !== "" && put(),
      onchange: () => (input.value === "" ? draw() : commit()),
      onkeydown: (/** @type {KeyboardEvent} */ event) => event.key === "Enter" && input.blur(),
    });
    const element = el(
      "label",
      {},
      el("span", {}, short),
      input,
      el("span", { class: "unit" }, unit),
    );
    return {
      element,
      input,
      /**
       * @param {number} value
       * @param {number} places
       */
      show(value, places) {
        if (document.activeElement !== input || input.value === "")
          input.value = String(Number(value.toFixed(places)) + 0);
        else if (Math.abs(Number(input.value) - value) > 10 ** -places && !placing.moved)
          input.value = String(Number(value.toFixed(places)) + 0);
      },
    };
  }
}

/** @param {{element: HTMLElement}[]} fields */
const grid = (fields) => el("div", { class: "place" }, ...fields.map(({ element }) => element));

/**
 * @param {string} title
 * @param {...HTMLElement} body
 */
const card = (title, ...body) => el("section", { class: "card" }, el("h3", {}, title), ...body);

/**
 * Return a group of buttons, one of which is pressed.
 * @param {string} label
 * @param {Record<string, string>} words
 * @param {(value: string) => void} take
 */
function segments(label, words, take) {
  const buttons = Object.entries(words).map(([value, text]) => ({
    value,
    button: el("button", { onclick: () => take(value) }, text),
  }));
  const all = buttons.map(({ button }) => button);
  return {
    element: el("div", { class: "segments", role: "group", "aria-label": label }, ...all),
    /** @param {string} now */
    show(now) {
      for (const { value, button } of buttons)
        button.setAttribute("aria-pressed", String(value === now));
    },
  };
}
