/** The contours in the scene: coloured lines, the chosen one, the kerf left behind, and the beam. */

import { Color, Group, Vector3 } from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

import { textSize, themeColour } from "../dom.js";
import { extent } from "../format.js";
import { alongScale } from "./scale.js";

/** @typedef {import("../messages.js").PlanMessage} PlanMessage */
/** @typedef {import("../timeline.js").Timeline} Timeline */
/** @typedef {"kind" | "speed" | "load" | "clearance"} ColourBy */

/**
 * A line through nodes as the scene draws it: of a plan, or of a contour without one.
 * @typedef {object} Track
 * @property {string} contour
 * @property {PlanMessage | null} plan
 * @property {number[] | null} clearance  K, m, where it is known
 * @property {number[]} points  K 3
 * @property {string[]} kind
 */

/** @param {string} kind */
const colourOfKind = (kind) =>
  themeColour(kind === "cut" ? "--cut" : kind.startsWith("lead") ? "--lead" : "--other");

/**
 * Return lines in a colour of the theme.
 * @param {number} width  of the usual text size
 * @param {string} colour  "": each vertex has its own
 * @param {number} order  later lines are drawn over earlier ones
 * @param {object} [more]
 */
export function line(width, colour, order, more = {}) {
  // Draw lines in front of the surface that they are on.
  const nearer = {
    depthWrite: false,
    polygonOffset: true,
    polygonOffsetFactor: -2,
    polygonOffsetUnits: -12,
  };
  const material = new LineMaterial({ linewidth: width, transparent: true, ...nearer, ...more });
  const made = new LineSegments2(new LineSegmentsGeometry(), material);
  made.frustumCulled = false;
  made.visible = false;
  made.renderOrder = order;
  made.userData = { width, colour };
  return made;
}

/**
 * Take the colours and the text size of the theme.
 * @param {LineSegments2[]} lines
 */
export function paintLines(lines) {
  for (const { material, userData } of lines) {
    material.linewidth = (userData.width * textSize()) / 13;
    if (userData.colour) material.color.set(themeColour(userData.colour));
  }
}

/** Distance from which on all distances have the same colour, m. */
export const FAR = 0.2;
/** @type {Partial<Record<ColourBy, [number, number]>>} scales that do not follow from the values */
const SCALES = { load: [0, 1], clearance: [0, FAR] };

export class Paths {
  constructor() {
    this.group = new Group();
    this.chosen = line(8, "--chosen", 1);
    this.through = line(1.6, "--accent", 1, { opacity: 0.35, depthTest: false });
    this.all = line(2.6, "", 2, { vertexColors: true });
    this.kerf = line(3.8, "--kerf", 3);
    this.beam = line(2.6, "--beam", 4, { opacity: 0.9 });
    this.executed = line(2.6, "--executed", 4);
    this.mark = line(7, "--alert", 5, { depthTest: false });
    this.lines = [
      this.chosen,
      this.through,
      this.all,
      this.kerf,
      this.beam,
      this.executed,
      this.mark,
    ];
    // All of these move with the part; the beam moves with the head.
    this.group.add(...this.lines.filter((each) => each !== this.beam));
    /** @type {Track[]} */
    this.tracks = [];
    /** @type {ColourBy} */
    this.by = "kind";
    /** Factor by which the errors of the executed paths are enlarged; 0: they are not drawn. */
    this.enlarged = 0;
    /** @type {[number, number]} of the values that are coloured by */
    this.range = [0, 1];
    /** @type {{end: number, begin: number, first: number, time: number[]}[]} spans in the kerf */
    this.cuts = [];
  }

  /** Take the colours and the text size of the theme. */
  paint() {
    paintLines(this.lines);
    this.colour();
  }

  /**
   * Draw these lines, and colour them again if they have changed.
   * @param {Track[]} tracks
   */
  load(tracks) {
    this.tracks = tracks;
    fill(this.all, tracks);
    this.enlarge();
    this.colour();
  }

  /**
   * Draw the executed paths with their errors enlarged.
   * @param {number} [factor]  0: none
   */
  enlarge(factor = this.enlarged) {
    this.enlarged = factor;
    const known = this.tracks.flatMap(({ plan }) => plan?.executed ?? []);
    fill(
      this.executed,
      (factor ? known : []).map(({ drawn, tip }) => ({
        points: drawn.map((at, i) => at + factor * (tip[i] - at)),
      })),
    );
  }

  /**
   * Colour the nodes by their kind, speed or joint load.
   * @param {ColourBy} [by]
   */
  colour(by = this.by) {
    this.by = by;
    const values = this.tracks.flatMap((track) => valuesOf(track, by) ?? []);
    this.range = SCALES[by] ?? extent(values);
    if (!this.tracks.length) return;
    const waiting = new Color(themeColour("--moving"));
    /** @type {number[]} */
    const colours = [];
    for (const track of this.tracks) {
      const { plan, points, kind } = track;
      const shown = plan && by !== "kind" ? valuesOf(track, by) : null;
      const [low, high] = this.range;
      const at = (/** @type {number} */ k) => {
        if (!plan || (by !== "kind" && !shown)) return waiting;
        if (!shown) return new Color(colourOfKind(kind[k]));
        return alongScale((shown[Math.min(k, shown.length - 1)] - low) / (high - low || 1));
      };
      for (let k = 0; k + 1 < points.length / 3; k++)
        colours.push(...at(k).toArray(), ...at(shown ? k + 1 : k).toArray());
    }
    this.all.geometry.setColors(colours);
  }

  /** @param {string | null} contour */
  choose(contour) {
    const chosen = this.tracks.filter((each) => each.contour === contour);
    for (const each of [this.chosen, this.through]) fill(each, chosen);
  }

  /**
   * Prepare the kerf: all cuts in the order of the program; those before the time are shown.
   * @param {Timeline} timeline
   */
  prepare(timeline) {
    this.cuts = [];
    const cuts = timeline.spans.flatMap(({ plan, begin, end }) =>
      plan ? { plan, begin, end } : [],
    );
    let first = 0;
    for (const { plan, begin, end } of cuts) {
      this.cuts.push({ begin, end, first, time: plan.time });
      first += plan.time.length - 1;
    }
    fill(
      this.kerf,
      cuts.map(({ plan }) => plan),
    );
  }

  /**
   * Show the kerf as it is at a time.
   * @param {number} t  s
   */
  cutUntil(t) {
    let shown = 0;
    for (const { begin, end, first, time } of this.cuts) {
      if (t >= end) shown = first + time.length - 1;
      else if (t > begin) {
        shown = first + time.findLastIndex((each) => begin + each <= t);
        break;
      } else break;
    }
    this.kerf.geometry.instanceCount = shown;
    this.kerf.visible = shown > 0 && this.by === "kind"; // otherwise it would hide the values
  }

  /**
   * Show the beam through the tip along the tool axis, or hide it.
   * @param {import("three").Matrix4 | null} tip  pose of the tip
   */
  shine(tip) {
    this.beam.visible = tip !== null;
    if (!tip) return;
    const ends = [-0.02, 0.045].map((by) => new Vector3(0, 0, by).applyMatrix4(tip));
    this.beam.geometry.setPositions(ends.flatMap((each) => [...each]));
  }

  /**
   * Mark a point, such as a break of the path; null removes the mark.
   * @param {number[] | null} point
   */
  markAt(point) {
    const r = 0.012;
    const [x, y, z] = point ?? [0, 0, 0];
    const ends = [
      [x - r, y - r, z, x + r, y + r, z],
      [x - r, y + r, z, x + r, y - r, z],
    ];
    fill(this.mark, point ? ends.map((points) => ({ points })) : []);
  }
}

/** @type {(track: Track, by: ColourBy) => number[] | null} */
function valuesOf({ plan, clearance }, by) {
  // Overlaps have the colour of values beyond the scale; large distances share one colour.
  if (by === "clearance")
    return clearance?.map((each) => (each < 0 ? 2 * FAR : Math.min(each, FAR))) ?? null;
  if (!plan) return null;
  return by === "speed" ? plan.speed : plan.joint_load;
}

/**
 * Draw lines through points.
 * @param {LineSegments2} target
 * @param {{points: number[]}[]} paths  K 3 each
 */
export function fill(target, paths) {
  /** @type {number[]} */
  const segments = [];
  for (const { points } of paths)
    for (let i = 0; i + 5 < points.length; i += 3)
      for (let j = 0; j < 6; j++) segments.push(points[i + j]);
  target.visible = segments.length > 0;
  if (!target.visible) return;
  target.geometry.dispose();
  target.geometry = new LineSegmentsGeometry();
  target.geometry.setPositions(segments);
}
