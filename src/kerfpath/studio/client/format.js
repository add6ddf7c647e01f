/** Numbers for display: SI units in, mm, deg, % and m/min out. */

const DEG = 180 / Math.PI;
const MINUS = "\u2212";

/**
 * @param {number} value
 * @param {number} [places]
 */
export function fixed(value, places = 1) {
  const text = Math.abs(value).toFixed(places);
  return value < 0 && Number(text) !== 0 ? MINUS + text : text;
}

/**
 * Return a number with about `digits` significant digits, without an exponent.
 * @param {number} value
 * @param {number} [digits]
 */
export function digits(value, digits = 3) {
  if (value === 0) return "0";
  const before = Math.floor(Math.log10(Math.abs(value))) + 1;
  return fixed(value, Math.min(6, Math.max(0, digits - before)));
}

/** @param {number} radians */
export const deg = (radians) => radians * DEG;

/** @param {number} radians */
export const degrees = (radians, places = 1) => `${fixed(deg(radians), places)} deg`;

/** @param {number} metres */
export const millimetres = (metres, places = 1) => `${fixed(metres * 1e3, places)} mm`;

/** @param {number} fraction */
export const percent = (fraction, places = 0) => `${fixed(fraction * 100, places)} %`;

/**
 * Return a time in the format 1:02.3.
 * @param {number} seconds
 */
export function clock(seconds, places = 1) {
  const unit = 10 ** places;
  const rounded = Math.round(seconds * unit) / unit;
  const minutes = Math.floor(rounded / 60);
  const rest = (rounded - minutes * 60).toFixed(places);
  return `${minutes}:${rest.padStart(places ? places + 3 : 2, "0")}`;
}

/**
 * Return a change in per cent with its sign.
 * @param {number} now
 * @param {number} before
 */
export function change(now, before) {
  if (before === 0) return "";
  const share = (now - before) / Math.abs(before);
  if (Math.abs(share) < 5e-4) return "same";
  return `${share > 0 ? "+" : MINUS}${digits(Math.abs(share) * 100, 2)} %`;
}

/**
 * Return "1 node" or "3 nodes".
 * @param {number} count
 * @param {string} word
 */
export const counted = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

/** @param {string} words */
export const capital = (words) => words[0].toUpperCase() + words.slice(1);

/**
 * Shown units by the units of the server, with the conversion of values.
 * @type {Record<string, {unit: string, of: (value: number) => number}>}
 */
const UNITS = {
  rad: { unit: "deg", of: deg },
  m: { unit: "mm", of: (value) => 1e3 * value },
  "m/s": { unit: "m/min", of: (value) => 60 * value },
  share: { unit: "% limit", of: (value) => 100 * value },
  "m^3": { unit: "m\u00b3", of: (value) => value },
};

/**
 * Return the shown unit for a unit of the server, and the conversion to it; other units stay.
 * @param {string} unit
 */
export const shownUnit = (unit) => UNITS[unit] ?? { unit, of: Number };

/**
 * Return an SI value in the units that are shown.
 * @param {number} value
 * @param {string} unit
 */
export function inUnits(value, unit) {
  if (unit === "rad") return degrees(value);
  if (unit === "m")
    return Math.abs(value) < 1e-6 ? "0 mm" : millimetres(value, Math.abs(value) < 1e-3 ? 4 : 2);
  if (unit === "share") return `${digits(100 * value, 3)} %`;
  return `${digits(value, 3)}${unit ? ` ${unit}` : ""}`;
}

/**
 * Return the least and the largest value; null does not count.
 * @param {(number | null)[]} values
 */
export function extent(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values)
    if (value !== null) [low, high] = [Math.min(low, value), Math.max(high, value)];
  return /** @type {[number, number]} */ ([low, high]);
}

/** @param {number[]} values */
export const sum = (values) => values.reduce((total, each) => total + each, 0);

/**
 * Return how long the cut of a contour takes, s.
 * @param {import("./messages.js").PlanMessage[]} plans  its pieces
 */
export const secondsOf = (plans) => sum(plans.map(({ time }) => time[time.length - 1]));
