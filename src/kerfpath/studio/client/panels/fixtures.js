/** The fixtures of the cell: boxes, cylinders and solids from files, below the contours at first. */

import { store } from "../app.js";
import { setKeys, valueOf } from "../job.js";
import { Input, NUMBER, html, icon, options } from "../ui.js";
import { opener, said, sent } from "./files.js";

/** @typedef {Record<string, any> & {name: string}} Fixture */

const NEAR_MISS = 5; // mm, as the comments of a first job say
const BELOW = 150; // mm, from the contours to a new fixture
const solid = { reading: "", why: "" };

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

/** Under the middle of the contours, and their size along x and y, mm. */
function under() {
  const points = (store.scene?.contours ?? []).flatMap(({ points: xyz }) => xyz);
  const along = [0, 1, 2].map((axis) => points.filter((_, i) => i % 3 === axis));
  const [x, y, z] = along.map((values) => [Math.min(...values), Math.max(...values)]);
  const mm = (/** @type {number} */ m) => Math.round(m * 1e3);
  return {
    at: [mm((x[0] + x[1]) / 2), mm((y[0] + y[1]) / 2), mm(z[0]) - BELOW],
    size: [mm(x[1] - x[0]), mm(y[1] - y[0])],
  };
}

/**
 * Return a name that no fixture has: the first one with a number, or the given one.
 * @param {string} stem
 * @param {boolean} numbered
 */
function free(stem, numbered) {
  const names = known().map(({ name }) => name);
  for (let number = 1; ; number++) {
    const name = numbered || number > 1 ? `${stem} ${number}` : stem;
    if (!names.includes(name)) return name;
  }
}

/** @type {Record<"size_mm" | "cylinder_mm", {word: string, size: string, parts: string[], make: () => object}>} */
const SHAPES = {
  size_mm: { word: "box", size: "Size", parts: ["x", "y", "z"], make: box },
  cylinder_mm: {
    word: "cylinder",
    size: "⌀, height",
    parts: ["diameter", "height"],
    make: cylinder,
  },
};
/** @type {Record<string, string>} */
const NAMES = { size_mm: "size", cylinder_mm: "size", xyz_mm: "place", rpy_deg: "turn" };
const POSE = /** @type {const} */ ({ xyz_mm: ["x", "y", "z"], rpy_deg: ["roll", "pitch", "yaw"] });

/** A box below the contours. */
function box() {
  const { at, size } = under();
  const [x, y, z] = at;
  return { size_mm: [size[0] + 100, size[1] + 100, 50], xyz_mm: [x, y, z - 25] };
}

/** A post below the contours. */
function cylinder() {
  const [x, y, z] = under().at;
  return { cylinder_mm: [60, 200], xyz_mm: [x, y, z - 100] };
}

/**
 * Make a solid in a file a fixture below the contours.
 * @param {File} file
 */
export function hold(file) {
  sent(
    solid,
    file,
    "solid",
    () => ({ unit: "mm" }),
    (answer) => {
      const {
        bounds_mm: [low, high],
        ...keys
      } = JSON.parse(answer);
      const [x, y, z] = under().at;
      const middle = [0, 1].map((k) => (low[k] + high[k]) / 2);
      const at = [x - middle[0], y - middle[1], z - high[2]].map(Math.round);
      const name = free(file.name.replace(/\.\w+$/, ""), false);
      keep([...known(), { name, ...keys, xyz_mm: at }]);
    },
  );
}

export function fixtures() {
  const list = known();
  const off = !store.live || !store.scene?.contours.length;
  const add = (/** @type {string} */ word, /** @type {() => object} */ make) =>
    keep([...list, { name: free(word, true), ...make() }]);
  const why = isSolid()
    ? "With a fixture, collisions of robot, head, part and fixtures are checked."
    : "With a fixture, collisions of robot, head and fixtures are checked; those with the part are not, as its drawing has only curves.";
  return html`
    <section class="card fixtures">
      <h3>Fixtures</h3>
      <div class="adders">
        ${Object.values(SHAPES).map(
          ({ word, make }) => html`
            <button class="plain" disabled=${off} onClick=${() => add(word, make)}>
              ${`Add a ${word}`}
            </button>`,
        )}
        ${opener("Open a solid", store.options?.solids ?? [], hold, off)}
      </div>
      ${said(solid, `Or drop a mesh (STL, OBJ, PLY) or a STEP file here. ${why}`)}
      ${list.map((each, i) => fixture(each, i, list))}
    </section>`;
}

/** @type {(each: Fixture, i: number, list: Fixture[]) => unknown} */
function fixture(each, i, list) {
  const set = (/** @type {Partial<Fixture>} */ keys) =>
    keep(list.map((one, at) => (at === i ? { ...one, ...keys } : one)));
  /** @type {(key: string, words: string, parts: readonly string[]) => unknown} */
  const row = (key, words, parts) => {
    const values = each[key] ?? [0, 0, 0];
    const unit = key.endsWith("_deg") ? "deg" : "mm";
    const take = (/** @type {number} */ k) => (/** @type {string} */ text) => {
      if (text === "" || !Number.isFinite(Number(text))) return;
      set({ [key]: values.with(k, Number(text)) });
    };
    return html`
      <span>${words}</span>
      ${parts.map(
        (part, k) => html`
          <${Input} ...${NUMBER} value=${String(values[k])} title=${`${part}, ${unit}`}
            aria-label=${`${each.name}, ${NAMES[key]} ${part}, ${unit}`}
            disabled=${!store.live} onSet=${take(k)} />`,
      )}
      <span class="unit" style=${{ gridColumn: 5 }}>${unit}</span>`;
  };
  const shape = Object.entries(SHAPES).find(([key]) => each[key]);
  return html`
    <div class="fixture" key=${each.name}>
      <strong>${each.name}</strong>
      <button class="tool" aria-label=${`Remove ${each.name}`} disabled=${!store.live}
        onClick=${() => keep(list.filter((_, at) => at !== i))}>${icon("close")}</button>
      <div class="sizes">
        ${shape ? row(shape[0], shape[1].size, shape[1].parts) : file(each, set)}
        ${row("xyz_mm", shape ? "Centre" : "Origin", POSE.xyz_mm)}
        ${row("rpy_deg", "Turn", POSE.rpy_deg)}
      </div>
    </div>`;
}

/** @type {(each: Fixture, set: (keys: Partial<Fixture>) => void) => unknown} a mesh has a unit */
const file = (each, set) => html`
  <span>File</span><span class="file">${each.file}</span>
  ${
    each.unit &&
    html`
      <select aria-label=${`${each.name}, unit of its file`} value=${each.unit}
        disabled=${!store.live}
        onChange=${(/** @type {any} */ { target }) => set({ unit: target.value })}>
        ${options((store.options?.solid_units ?? []).map((unit) => ({ value: unit, label: unit })))}
      </select>`
  }`;
