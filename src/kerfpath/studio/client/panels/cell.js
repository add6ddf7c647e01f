/** The cell in a sheet: the part's drawing, robot, head, language, home and fixtures. */

import { player, store } from "../app.js";
import { axesOf } from "../axes.js";
import { isGiven, setKeys, valueOf } from "../job.js";
import { Input, NUMBER, html, icon, options, redraw } from "../ui.js";
import { openSheet } from "./sheet.js";

/** @typedef {import("../messages.js").RobotChoice} Robot */
/** @typedef {Record<string, any> & {name: string}} Fixture */

const NEAR_MISS = 5; // mm, as the comments of a first job say
const part = { reading: "", why: "", unit: "", /** @type {File | null} */ file: null };

/** @type {import("./sheet.js").Sheet} */
export const cellSheet = {
  docked: true,
  content: () => ({ title: "Cell", body }),
};

/** Take drawings that are dropped anywhere on the page. */
export function followDrops() {
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    const file = event.dataTransfer?.files[0];
    if (!file) return;
    event.preventDefault();
    openSheet("cell");
    begin(file);
  });
}

let turn = Promise.resolve(); // files are read one after the other

/**
 * Begin a new job with a drawing.
 * @param {File} file
 */
const begin = (file) => (turn = turn.then(() => read(file)));

/** @param {File} file */
async function read(file) {
  Object.assign(part, { reading: file.name, why: "", file });
  redraw();
  const query = new URLSearchParams({ robot: valueOf("robot.model") ?? "", unit: part.unit });
  try {
    const address = `part/${encodeURIComponent(file.name)}?${query}`;
    const answer = await fetch(address, { method: "POST", body: file });
    part.why = answer.ok ? "" : await answer.text();
  } catch {
    part.why = "The studio's server does not answer; try again.";
  }
  part.reading = "";
  redraw();
}

const body = () => html`
  <div class="cards">
    ${drawing()}${robot()}${headAndLanguage()}${home()}${fixtures()}
  </div>`;

/**
 * A button that opens a file of this machine.
 * @param {string} words
 * @param {string[]} suffixes
 * @param {(file: File) => void} take
 */
function opener(words, suffixes, take) {
  const pick = (/** @type {any} */ { target }) => {
    if (target.files.length) take(target.files[0]);
    target.value = ""; // the same file may be opened again
  };
  return html`
    <label class="plain">
      ${icon("file")}${words}
      <input type="file" class="unseen" accept=${suffixes.join(",")}
        disabled=${!store.live} onChange=${pick} />
    </label>`;
}

function drawing() {
  const { suffixes = [], units = [] } = store.options ?? {};
  const measure = (/** @type {any} */ { target }) => {
    part.unit = target.value;
    if (part.why && part.file) begin(part.file);
  };
  const choices = [{ value: "", label: "as the file says" }, ...units.map(worded)];
  return html`
    <section class="card">
      <header>
        <h3>Part</h3><span class="grow" />
        ${opener("Open a drawing", suffixes, begin)}
      </header>
      <p class="file">${valueOf("part.file") ?? "none"}</p>
      <p class="field row">
        <span>Unit</span>
        <select aria-label="Unit of the drawing" value=${part.unit} onChange=${measure}>
          ${options(choices)}
        </select>
      </p>
      <p class="quiet small" aria-live="polite">
        ${
          part.reading
            ? `Reading ${part.reading} …`
            : "Or drop a STEP, IGES or DXF file on the page. It begins a new job with this robot, head and language; Undo brings the job before back."
        }
      </p>
      ${part.why && html`<p class="fault" role="alert">${part.why}</p>`}
    </section>`;
}

function robot() {
  const { robots = [] } = store.options ?? {};
  const now = valueOf("robot.model") ?? "";
  const found = robots.find(({ id }) => id === now);
  const choose = (/** @type {any} */ { target }) => {
    const to = robots.find(({ id }) => id === target.value);
    if (to) changeRobot(to, found);
  };
  return html`
    <section class="card">
      <h3>Robot</h3>
      <select aria-label="Robot" value=${now} disabled=${!store.live} onChange=${choose}>
        ${!found && html`<option value=${now}>${now || "of a description (URDF)"}</option>`}
        ${[...Map.groupBy(robots, ({ maker }) => maker)].map(
          ([maker, models]) => html`
            <optgroup key=${maker} label=${maker}>
              ${options(models.map(({ id, model }) => ({ value: id, label: model })))}
            </optgroup>`,
        )}
      </select>
      ${found && about(found)}
    </section>`;
}

/** @param {Robot} found */
const about = ({ id, maker, model, reach, payload, joints, ratio, missing }) => html`
  <div class="robot">
    <img src=${`robot/${id}.svg${location.search}`} alt=${`${maker} ${model}`} width="200" height="170" />
    <dl class="facts">
      <dt>Reach</dt><dd>${reach === null ? "not known" : `${reach} m`}</dd>
      <dt>Payload</dt><dd>${payload === null ? "not known" : `${payload} kg`}</dd>
      <dt>Joints</dt><dd>${joints}</dd>
    </dl>
  </div>
  ${missing && html`<p class="fault">The job must give its limits: ${missing}</p>`}
  ${
    ratio &&
    isGiven("robot.acceleration_ratio") &&
    html`<p class="quiet small">Accelerations are a typical ratio to the speeds, as the maker publishes none.</p>`
  }`;

/**
 * Put another robot of the library into the job, and a language that its controller has.
 * @param {Robot} to
 * @param {Robot | undefined} from
 */
function changeRobot(to, from) {
  const given = store.job?.given ?? [];
  const own = given.filter((key) => /^robot\.\w+$/.test(key) && key !== "robot.model");
  /** @type {[string, unknown][]} */
  const changes = own.map((key) => [key, null]);
  changes.push(["robot.model", to.id]);
  if (to.ratio) changes.push(["robot.acceleration_ratio", to.ratio]);
  const other = from?.kinematics !== to.kinematics;
  for (const key of ["plan.posture", "sequence.home_deg"])
    if (isGiven(key) && other) changes.push([key, null]);
  const spoken = valueOf("program.language");
  if (spoken !== "none" && to.languages.length && !to.languages.includes(spoken))
    changes.push(...languageTo(to.languages[0]));
  const known = new Map(changes); // a key that is removed and set is set
  setKeys(...known);
}

/**
 * Return the changes that write the program in another language.
 * @param {string} to
 * @returns {[string, unknown][]}
 */
function languageTo(to) {
  const from = valueOf("program.language");
  /** @type {[string, unknown][]} */
  const removed = isGiven(`program.${from}`) ? [[`program.${from}`, null]] : [];
  return [...removed, ["program.language", to]];
}

function headAndLanguage() {
  const { heads = [], languages = [] } = store.options ?? {};
  const head = valueOf("tool.head") ?? "";
  const language = valueOf("program.language") ?? "";
  const mount = (/** @type {any} */ { target }) => {
    const others = ["tool.xyz_mm", "tool.rpy_deg"].filter(isGiven);
    /** @type {[string, unknown][]} */
    const removed = others.map((key) => [key, null]);
    setKeys(...removed, ["tool.head", target.value]);
  };
  const speak = (/** @type {any} */ { target }) => setKeys(...languageTo(target.value));
  const own = head ? [] : [{ value: "", label: "own, by its tip in the flange" }];
  return html`
    <section class="card">
      <h3>Head and controller</h3>
      <p class="field row">
        <span>Head</span>
        <select aria-label="Head" value=${head} disabled=${!store.live} onChange=${mount}>
          ${options([...own, ...heads.map(worded)])}
        </select>
      </p>
      <p class="field row">
        <span>Language</span>
        <select aria-label="Language of the controller" value=${language} disabled=${!store.live}
          onChange=${speak}>
          ${options(languages.map(worded))}
        </select>
      </p>
    </section>`;
}

/** @param {string} word */
const worded = (word) => ({ value: word, label: word });

function home() {
  const now = valueOf("sequence.home_deg");
  const take = () => {
    const q = player.moment?.q ?? store.scene?.sample.q;
    const axes = axesOf(store.scene?.robot).filter(({ external }) => !external);
    if (q) setKeys(["sequence.home_deg", axes.map(({ of }, j) => Number(of(q[j]).toFixed(2)))]);
  };
  return html`
    <section class="card">
      <header>
        <h3>Home</h3><span class="grow" />
        <button class="plain" disabled=${!store.live || !store.scene} onClick=${take}>
          ${icon("follow")}Take the shown pose
        </button>
      </header>
      <p class="quiet small">
        ${now ? `${now.join(", ")} deg` : "None: the program begins and ends at the contours."}
      </p>
    </section>`;
}

/** @returns {Fixture[]} those of the job, with the keys that they have */
const known = () =>
  (valueOf("cell.fixture") ?? []).map((/** @type {Fixture} */ each) =>
    Object.fromEntries(Object.entries(each).filter(([, value]) => value !== null)),
  );

/** Whether the drawing has faces, with which collisions can be checked. */
const isSolid = () => store.scene?.bodies.some(({ kind }) => kind === "part") ?? false;

/** @param {Fixture[]} list  a job without [cell] gets one, with a near-miss distance */
function keep(list) {
  /** @type {[string, unknown][]} */
  const added = [];
  if (valueOf("cell") === null) {
    added.push(["cell.near_miss_mm", NEAR_MISS]);
    if (!isSolid()) added.push(["cell.part", false]);
  }
  setKeys(...added, ["cell.fixture", list.length ? list : null]);
}

/** A box below the contours. */
function below() {
  const points = (store.scene?.contours ?? []).flatMap(({ points: xyz }) => xyz);
  const along = [0, 1, 2].map((axis) => points.filter((_, i) => i % 3 === axis));
  const [x, y, z] = along.map((values) => [Math.min(...values), Math.max(...values)]);
  const mm = (/** @type {number} */ m) => Math.round(m * 1e3);
  const names = known().map(({ name }) => name);
  let number = 1;
  while (names.includes(`box ${number}`)) number++;
  return {
    name: `box ${number}`,
    size_mm: [mm(x[1] - x[0]) + 100, mm(y[1] - y[0]) + 100, 50],
    xyz_mm: [mm((x[0] + x[1]) / 2), mm((y[0] + y[1]) / 2), mm(z[0]) - 175],
  };
}

function fixtures() {
  const list = known();
  const off = !store.live || !store.scene?.contours.length;
  return html`
    <section class="card">
      <header>
        <h3>Fixtures</h3><span class="grow" />
        <button class="plain" disabled=${off} onClick=${() => keep([...list, below()])}>
          Add a box
        </button>
      </header>
      ${list.map((each, i) => fixture(each, i, list))}
      <p class="quiet small">
        ${
          isSolid()
            ? "With a fixture, collisions of robot, head, part and fixtures are checked."
            : "With a fixture, collisions of robot, head and fixtures are checked; those with the part are not, as its drawing has only curves."
        }
      </p>
    </section>`;
}

/** @type {(each: Fixture, i: number, list: Fixture[]) => unknown} */
function fixture(each, i, list) {
  /** @type {(key: string, k: number) => unknown} */
  const field = (key, k) => {
    const set = (/** @type {string} */ text) => {
      if (text === "" || !Number.isFinite(Number(text))) return;
      const now = list.map((one) => ({ ...one }));
      now[i][key] = each[key].map((/** @type {number} */ old, /** @type {number} */ at) =>
        at === k ? Number(text) : old,
      );
      keep(now);
    };
    const words = `${each.name}, ${key === "size_mm" ? "size" : "centre"} ${"xyz"[k]}, mm`;
    return html`
      <${Input} ...${NUMBER} value=${String(each[key][k])} aria-label=${words}
        disabled=${!store.live} onSet=${set} />`;
  };
  const row = (/** @type {string} */ key, /** @type {string} */ words) => html`
    <span>${words}</span>${[0, 1, 2].map((k) => field(key, k))}<span class="unit">mm</span>`;
  return html`
    <div class="fixture" key=${each.name}>
      <strong>${each.name}</strong>
      <button class="tool" aria-label=${`Remove ${each.name}`} disabled=${!store.live}
        onClick=${() => keep(list.filter((_, at) => at !== i))}>${icon("close")}</button>
      <div class="sizes">
        ${each.size_mm ? row("size_mm", "Size") : html`<span>${each.file}</span>`}
        ${row("xyz_mm", each.size_mm ? "Centre" : "Origin")}
      </div>
    </div>`;
}
