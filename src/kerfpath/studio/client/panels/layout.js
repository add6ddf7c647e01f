/** The placement of the part: moved by numbers or handles, with its reach and fastest speed. */

import { useLayoutEffect, useRef } from "preact/hooks";

import { send, store } from "../app.js";
import { change, counted, fixed, sum } from "../format.js";
import { NUMBER, blurOnEnter, html, redraw, segments } from "../ui.js";
import { candidates } from "./candidates.js";

/** @typedef {import("../scene/placing.js").What} What */
/** @typedef {import("../messages.js").ReachMessage} ReachMessage */

const PATIENCE = 2000; // ms to wait for an answer
const WHAT = [
  { value: "part", label: "Part" },
  { value: "robot", label: "Robot" },
];
const HOW = [
  { value: "move", label: "Move" },
  { value: "turn", label: "Turn" },
];

/** A key for the place of part and tip. */
const placeNow = () => JSON.stringify([store.scene?.T_part, store.scene?.robot.T_tool]);

/**
 * The sheet of the placement.
 * @param {import("../scene/placing.js").Placing} placing
 * @returns {import("./sheet.js").Sheet}
 */
export function layoutSheet(placing) {
  const question = { number: 0, asked: 0, again: false }; // asked: ms, 0: it is answered
  let [turns, revision] = [false, 0];
  const search = candidates(placing, moved);
  const speed = fastestHere(placing);
  placing.dragged = (done) => {
    search.forget();
    if (done) commit();
    else moved();
  };
  store.on(["job"], () => {
    if (!placing.open || store.job?.revision === revision) return;
    revision = store.job?.revision ?? 0;
    if (!placing.awaits) placing.reset();
    placing.awaits = false;
    ask();
  });
  store.on(["scene"], ask);
  store.on(["reach"], heard);
  store.on(["connection"], () => (question.asked = 0));
  store.on(["error"], ({ about }) => {
    if (about === "place" || about === "take") placing.reset();
    if (about === "reach") question.asked = 0;
  });
  return {
    docked: true,
    content: () => ({ title: "Layout", body }),
    closed: () => placing.show(false),
    opened() {
      revision = store.job?.revision ?? 0;
      placing.show(true);
      placing.choose(placing.what, turns);
      ask();
      document.querySelector(/** @type {"input"} */ (".place input"))?.focus();
    },
  };

  /** Show the new placement, and ask for its reach. */
  function moved() {
    redraw();
    ask();
  }

  /** Write the move to the job, as one step of undo. */
  function commit() {
    const offsets = placing.offsets();
    if (store.scene && Object.keys(offsets).length)
      placing.sent(send({ type: "place", scene: store.scene.revision, offsets }));
    moved();
  }

  /** Ask for the reach; if an answer is awaited, ask again after it. */
  function ask() {
    if (!placing.open || store.connection !== "open") return;
    question.again = performance.now() - question.asked < PATIENCE && question.asked > 0;
    if (question.again) return;
    question.asked = performance.now();
    send({ type: "reach", offsets: placing.offsets(), number: ++question.number });
  }

  /** @param {ReachMessage} answer */
  function heard(answer) {
    if (answer.number !== question.number) return;
    question.asked = 0;
    if (!placing.open) return;
    if (answer.revision === store.scene?.revision) placing.take(answer);
    if (question.again) ask();
  }

  /** @param {string} what @param {boolean} turn */
  function choose(what, turn) {
    turns = turn;
    placing.choose(/** @type {What} */ (what), turns);
  }

  function body() {
    return html`
      <div class="cards">
        <section class="card">
          <h3>Position</h3>
          <div class="pair">
            ${segments("Body to move", WHAT, placing.what, (what) => choose(what, turns))}
            ${segments("How", HOW, turns ? "turn" : "move", (how) => choose(placing.what, how === "turn"))}
          </div>
          ${fields()}
        </section>
        <section class="card">
          <h3>Reach</h3>
          <div class="reach" aria-live="polite">${reach(placing.reach)}</div>
        </section>
        <section class="card">
          <h3>Fastest speed</h3>
          <div aria-live="polite">${speed()}</div>
        </section>
        ${search.card()}
      </div>`;
  }

  /** The numbers of the placement. */
  function fields() {
    const place = () => placing.place ?? { xyz: [0, 0, 0], rpy: [0, 0, 0] };
    const { xyz, rpy } = place();
    /** @type {(which: "xyz" | "rpy", i: number) => (to: number) => void} */
    const putPart = (which, i) => (to) => {
      const now = place(); // not what was drawn last
      now[which][i] = to;
      placing.put(now.xyz, now.rpy);
    };
    const offsets = placing.offsets();
    const base = ["x", "y", "z"].map((axis) => offsets[`base_${axis}_mm`] ?? 0);
    const [yaw, mount] = [offsets.base_yaw_deg ?? 0, offsets.mount_deg ?? 0];
    /** @type {(label: string, short: string, unit: string, step: number, value: number, put: (value: number) => void) => unknown} */
    const field = (label, short, unit, step, value, put) => {
      const set = (/** @type {number} */ to) => {
        search.forget();
        put(to);
        moved();
      };
      const is = { label: `${label}, ${unit}`, short, unit, step, value, put: set, commit };
      return html`<${Place} key=${label} ...${is} moved=${placing.moved} />`;
    };
    return html`
      <div class="place">
        ${["x", "y", "z"].map((axis, i) =>
          field(`Part ${axis}`, axis, "mm", 10, xyz[i], putPart("xyz", i)),
        )}
        ${["roll", "pitch", "yaw"].map((turn, i) =>
          field(`Part ${turn}`, turn, "deg", 1, rpy[i], putPart("rpy", i)),
        )}
      </div>
      <details class="group-of-keys">
        <summary>Robot and head, moved by</summary>
        <div class="place">
          ${["x", "y", "z"].map((axis, i) =>
            field(`Robot base ${axis}, by`, axis, "mm", 10, base[i], (to) =>
              placing.moveRobot(base.with(i, to), yaw, mount),
            ),
          )}
          ${field("Robot base turned by", "yaw", "deg", 1, yaw, (to) =>
            placing.moveRobot(base, to, mount),
          )}
          ${field("Head turned by", "head", "deg", 5, mount, (to) =>
            placing.moveRobot(base, yaw, to),
          )}
        </div>
        <p class="quiet small">
          The job is written in the robot's base: if the base moves, all else moves the other way.
        </p>
      </details>`;
  }
}

/**
 * A number of the placement, which is sent once it is complete.
 * @param {{label: string, short: string, unit: string, step: number, value: number, moved: boolean,
 *   put: (value: number) => void, commit: () => void}} props
 */
function Place({ label, short, unit, step, value, moved, put, commit }) {
  const input = useRef(/** @type {HTMLInputElement | null} */ (null));
  const places = unit === "mm" ? 2 : 3;
  const given = () => (input.current?.value ?? "") !== "";
  useLayoutEffect(() => {
    const { current } = input;
    if (!current) return;
    // An empty field with the focus waits for digits; a sign alone counts as empty, too.
    const typing = document.activeElement === current;
    const other = Math.abs(Number(current.value) - value) > 10 ** -places && !moved && given();
    if (!typing || other) current.value = String(Number(value.toFixed(places)) + 0);
  });
  return html`
    <label>
      <span>${short}</span>
      <input ref=${input} ...${NUMBER} step=${step} disabled=${!store.live} aria-label=${label}
        onInput=${() => given() && put(Number(input.current?.value))}
        onChange=${() => given() && commit()} onKeyDown=${blurOnEnter} />
      <span class="unit">${unit}</span>
    </label>`;
}

/** @param {ReachMessage | null} answer */
function reach(answer) {
  const contours = answer?.contours ?? [];
  const lost = contours.filter(({ out }) => out.length);
  const count = sum(lost.map(({ out }) => out.length));
  const nodes = counted(sum(contours.map((each) => each.nodes)), "node");
  const all = counted(contours.length, "contour");
  const words = !answer
    ? "Testing what the robot reaches."
    : count
      ? `Out of reach: ${count} of ${nodes}, on ${lost.length} of ${all}.`
      : `All ${nodes} of ${all} are within reach.`;
  const rows = lost.map(({ name, nodes: of, out }) => {
    const part = out.length === of ? "all of it" : `${out.length} of ${counted(of, "node")}`;
    return html`<li>${name}: ${part}</li>`;
  });
  return html`
    <p class=${count ? "fault" : ""}><i class=${`stroke ${count ? "lost" : "here"}`} />${words}</p>
    ${count > 0 && html`<ul class="quiet small">${rows}</ul>`}`;
}

/**
 * Return what draws the fastest speed of the chosen contour; it is searched for once the server is
 * idle.
 * @param {import("../scene/placing.js").Placing} placing
 */
function fastestHere(placing) {
  let [looked, looking] = ["", false]; // for which job and contour it was asked for
  /** @type {Map<string, {place: string, now: number | null, before: number | null}>} by contour */
  const speeds = new Map();
  store.on(["anything"], consider);
  store.on(["error"], ({ about }) => about === "fastest" && found(null));
  store.on(["fastest"], ({ contour, revision, speed_m_min: now }) => {
    if (revision === store.job?.revision && contour === store.selected) found(now);
  });
  return content;

  /** What is known of the chosen contour where the part is. */
  function known() {
    const { selected, job, outcome, progress } = store;
    const speed = speeds.get(selected ?? "");
    const out = placing.reach?.contours.find(({ name }) => name === selected)?.out.length ?? 0;
    const settled = !progress.busy && outcome?.revision === job?.revision && !job?.faults.length;
    const idle = settled && !placing.moved && store.layout?.state !== "running";
    return {
      speed,
      key: `${job?.revision} ${selected}`,
      here: speed?.place === placeNow(),
      out,
      idle,
    };
  }

  function consider() {
    if (!placing.open || !store.selected || !store.job) return;
    const { key, here, out, idle } = known();
    if (looking && !store.progress.busy && looked !== key) looking = false;
    if (idle && placing.reach && !out && looked !== key && !here) find();
  }

  function find() {
    looked = known().key;
    looking = send({ type: "fastest", contour: store.selected ?? "" });
  }

  function stop() {
    looking = false;
    send({ type: "cancel" });
  }

  /** @param {number | null} now  m/min */
  function found(now) {
    const { selected } = store;
    if (!selected || (!looking && now === null)) return;
    looking = false;
    const [last, place] = [speeds.get(selected), placeNow()];
    const before = last?.place === place ? last.before : (last?.now ?? null);
    speeds.set(selected, { place, now, before });
  }

  function content() {
    if (!store.selected) return null;
    const { speed, key, here, out, idle } = known();
    const still = here && !placing.moved;
    const now = (still && !out && speed?.now) || null;
    const was = still ? speed?.before : speed?.now;
    const why = placing.moved
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
    const gain = still && speed?.now && was ? ` ${change(speed.now, was)}` : "";
    const offer = idle && !here && !out && looked === key;
    return html`
      <p class="quiet small">Constant speed along ${store.selected}.</p>
      <dl class="facts">
        <dt>here</dt>
        <dd>${now ? `${fixed(now, 2)} m/min` : why}${gain && html`<span class="quiet">${gain}</span>`}</dd>
        <dt>before</dt>
        <dd>${was ? `${fixed(was, 2)} m/min` : "–"}</dd>
      </dl>
      ${
        looking
          ? html`<button class="text" onClick=${stop}>Stop the search</button>`
          : offer && html`<button class="text" onClick=${find}>Find the fastest</button>`
      }`;
  }
}
