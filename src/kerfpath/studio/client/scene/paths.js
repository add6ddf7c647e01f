/** The contours in the scene: coloured lines, the chosen one, the kerf left behind, and the beam. */

import { Color, Group, Vector3 } from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

import { textSize, themeColour } from "../dom.js";
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
 * @param {number} width  of the usual text size
 * @param {object} [more]
 */
export function line(width, more = {}) {
  // Draw lines in front of the surface that they are on, and later lines over earlier ones.
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
  made.userData.width = width;
  return made;
}

/** Distance from which on all distances have the same colour, m. */
export const FAR = 0.2;

export class Paths {
  constructor() {
    this.group = new Group();
    this.all = line(2.6, { vertexColors: true });
    this.chosen = line(8);
    this.through = line(1.6, { opacity: 0.35, depthTest: false });
    this.kerf = line(3.8);
    this.beam = line(2.6, { opacity: 0.9 });
    this.mark = line(7, { depthTest: false });
    this.chosen.renderOrder = this.through.renderOrder = 1;
    this.all.renderOrder = 2;
    this.kerf.renderOrder = 3;
    this.beam.renderOrder = 4;
    this.mark.renderOrder = 5;
    this.lines = [this.chosen, this.through, this.all, this.kerf, this.beam, this.mark];
    // All of these move with the part; the beam moves with the head.
    this.group.add(...this.lines.filter((each) => each !== this.beam));
    /** @type {Track[]} */
    this.tracks = [];
    /** @type {ColourBy} */
    this.by = "kind";
    /** @type {[number, number]} of the values that are coloured by */
    this.range = [0, 1];
    /** @type {{end: number, begin: number, first: number, time: number[]}[]} spans in the kerf */
    this.cuts = [];
  }

  /** Take the colours and the text size of the theme. */
  paint() {
    const scale = textSize() / 13;
    for (const each of this.lines) each.material.linewidth = each.userData.width * scale;
    this.chosen.material.color.set(themeColour("--chosen"));
    this.through.material.color.set(themeColour("--accent"));
    this.kerf.material.color.set(themeColour("--kerf"));
    this.beam.material.color.set(themeColour("--beam"));
    this.mark.material.color.set(themeColour("--alert"));
    this.colour();
  }

  /**
   * Draw these lines, and colour them again if they have changed.
   * @param {Track[]} tracks
   */
  load(tracks) {
    this.tracks = tracks;
    fill(
      this.all,
      tracks.flatMap(({ points }) => pairs(points)),
    );
    this.colour();
  }

  /**
   * Colour the nodes by their kind, speed or joint load.
   * @param {ColourBy} [by]
   */
  colour(by = this.by) {
    this.by = by;
    const values = this.tracks.flatMap((track) => valuesOf(track, by) ?? []);
    this.range =
      by === "load"
        ? [0, 1]
        : by === "clearance"
          ? [0, FAR]
          : [least(values), -least(values.map((v) => -v))];
    if (!this.tracks.length) return;
    const waiting = new Color(themeColour("--moving"));
    /** @type {number[]} */
    const colours = [];
    for (const track of this.tracks) {
      const { plan, points, kind } = track;
      const shown = plan && by !== "kind" ? valuesOf(track, by) : null;
      const at = (/** @type {number} */ k) =>
        !plan || (by !== "kind" && !shown)
          ? waiting
          : shown
            ? alongScale(
                (shown[Math.min(k, shown.length - 1)] - this.range[0]) /
                  (this.range[1] - this.range[0] || 1),
              )
            : new Color(colourOfKind(kind[k]));
      for (let k = 0; k + 1 < points.length / 3; k++)
        colours.push(...at(k).toArray(), ...at(shown ? k + 1 : k).toArray());
    }
    this.all.geometry.setColors(colours);
  }

  /** @param {string | null} contour */
  choose(contour) {
    const chosen = this.tracks.filter((each) => each.contour === contour);
    for (const each of [this.chosen, this.through])
      fill(
        each,
        chosen.flatMap(({ points }) => pairs(points)),
      );
  }

  /**
   * Prepare the kerf: all cuts in the order of the program; those before the time are shown.
   * @param {Timeline} timeline
   */
  prepare(timeline) {
    this.cuts = [];
    /** @type {number[]} */
    const points = [];
    for (const { plan, begin, end } of timeline.spans) {
      if (!plan) continue;
      this.cuts.push({ begin, end, first: points.length / 6, time: plan.time });
      for (const each of pairs(plan.points)) points.push(each);
    }
    fill(this.kerf, points);
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
   * @param {ArrayLike<number> | null} tip  pose of the tip
   */
  shine(tip) {
    this.beam.visible = tip !== null;
    if (!tip) return;
    const at = new Vector3(tip[3], tip[7], tip[11]);
    const axis = new Vector3(tip[2], tip[6], tip[10]);
    const [from, to] = [
      at.clone().addScaledVector(axis, -0.02),
      at.clone().addScaledVector(axis, 0.045),
    ];
    this.beam.geometry.setPositions([...from.toArray(), ...to.toArray()]);
  }

  /**
   * Mark a point, such as a break of the path; null removes the mark.
   * @param {number[] | null} point
   */
  markAt(point) {
    if (!point) {
      this.mark.visible = false;
      return;
    }
    const r = 0.012;
    const [x, y, z] = point;
    fill(this.mark, [x - r, y - r, z, x + r, y + r, z, x - r, y + r, z, x + r, y - r, z]);
  }
}

/** @param {number[]} values */
const least = (values) => values.reduce((low, value) => Math.min(low, value), Infinity);

/**
 * @param {Track} track
 * @param {ColourBy} by
 */
function valuesOf({ plan, clearance }, by) {
  // Overlaps have the colour of values beyond the scale; large distances share one colour.
  if (by === "clearance")
    return clearance?.map((each) => (each < 0 ? 2 * FAR : Math.min(each, FAR))) ?? null;
  if (!plan) return null;
  return by === "speed" ? plan.speed : plan.joint_load;
}

/**
 * Return the segments between successive points.
 * @param {number[]} points  K 3
 * @returns {number[]} (K-1) 6
 */
export function pairs(points) {
  /** @type {number[]} */
  const out = [];
  for (let i = 0; i + 5 < points.length; i += 3)
    for (let j = 0; j < 6; j++) out.push(points[i + j]);
  return out;
}

/**
 * @param {LineSegments2} target
 * @param {number[]} points
 */
export function fill(target, points) {
  target.visible = points.length > 0;
  if (!points.length) return;
  target.geometry.dispose();
  target.geometry = new LineSegmentsGeometry();
  target.geometry.setPositions(points);
}
