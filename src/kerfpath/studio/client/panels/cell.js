/** The cell in a sheet: the part's drawing, robot, head, language, home and fixtures. */

import { player, store } from "../app.js";
import { axesOf } from "../axes.js";
import { isGiven, setKeys, valueOf } from "../job.js";
import { html, icon, options } from "../ui.js";
import { opener, said, sent } from "./files.js";
import { fixtures, hold } from "./fixtures.js";
import { openSheet } from "./sheet.js";

/** @typedef {import("../messages.js").RobotChoice} Robot */

/** @type {{reading: string, why: string, unit: string, file: File | null}} */
const part = { reading: "", why: "", unit: "", file: null };

/** @type {import("./sheet.js").Sheet} */
export const cellSheet = {
  docked: true,
  content: () => ({ title: "Cell", body }),
};

/** Take files that are dropped: on the fixtures as one, elsewhere as the drawing of the part. */
export function followDrops() {
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    const file = event.dataTransfer?.files[0];
    if (!file) return;
    event.preventDefault();
    if (/** @type {Element} */ (event.target).closest(".fixtures")) return hold(file);
    openSheet("cell");
    begin(file);
  });
}

/**
 * Begin a new job with a drawing.
 * @param {File} file
 */
function begin(file) {
  part.file = file;
  sent(part, file, "part", () => ({ robot: valueOf("robot.model") ?? "", unit: part.unit }));
}

const body = () => html`
  <div class="cards">
    ${drawing()}${robot()}${headAndLanguage()}${home()}${fixtures()}
  </div>`;

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
      ${said(part, "Or drop a STEP, IGES or DXF file on the page. It begins a new job with this robot, head and language; Undo brings the job before back.")}
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
    const { moment } = player;
    const axes = axesOf(store.scene?.robot).filter(({ external }) => !external);
    if (moment)
      setKeys(["sequence.home_deg", axes.map(({ of }, j) => Number(of(moment.q[j]).toFixed(2)))]);
  };
  return html`
    <section class="card">
      <header>
        <h3>Home</h3><span class="grow" />
        <button class="plain" title="The pose of the plan at the moment that is shown"
          disabled=${!store.live || !player.moment} onClick=${take}>
          ${icon("follow")}Take the shown pose
        </button>
      </header>
      <p class="quiet small">
        ${now ? `${now.join(", ")} deg` : "None: the program begins and ends at the contours."}
      </p>
    </section>`;
}
