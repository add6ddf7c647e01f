/** The cells of a map as pixels: a colour and a pattern for each reason, in either theme. */

import { alongScale } from "../scene/scale.js";
import { WHOLE } from "./window.js";

/** @typedef {import("./grid.js").Grid} Grid */
/** @typedef {[number, number, number]} Rgb */
/** @typedef {"none" | "rising" | "falling" | "dots" | "cross" | "level"} Pattern */
/** @typedef {{base: Rgb, mark: Rgb, pattern: Pattern, free: boolean}} Ink */

/** Codes of a shade: bodies too close, and no pose; lower codes are along its scale. */
export const [TOO_NEAR, NO_SHADE] = [254, 255];
/** The code of the end of the scale. */
export const MOST = 253;

/**
 * @param {string} hex  #rrggbb
 * @returns {Rgb}
 */
const rgb = (hex) => {
  const value = parseInt(hex.slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255];
};

/**
 * @param {Rgb} a
 * @param {Rgb} b
 * @param {number} share  of b
 * @returns {Rgb}
 */
const mix = (a, b, share) => {
  const at = (/** @type {number} */ i) => Math.round(a[i] + (b[i] - a[i]) * share);
  return [at(0), at(1), at(2)];
};

/** @type {Record<string, Pattern>} by kind of reason; pinned: hatched where the pin is drawn */
const PATTERNS = { reach: "dots", cell: "cross", margin: "level" };

/**
 * Return the pattern of a reason; it repeats the colour for people who cannot distinguish colours.
 * @param {string} kind
 * @param {string} words
 * @returns {Pattern}
 */
function patternOf(kind, words) {
  if (kind === "joint") return words.endsWith("low") ? "falling" : "rising";
  return PATTERNS[kind] ?? "none";
}

/**
 * Return how each code of a map is painted.
 * @param {import("../messages.js").MapMessage} map
 * @param {boolean} dark
 * @param {string} open  #rrggbb, of what is admitted
 * @param {boolean} shaded  what is lost steps back
 * @returns {Ink[]}
 */
export function inks(map, dark, open, shaded) {
  return map.reasons.map((words, code) => {
    const pattern = patternOf(map.kinds[code], words);
    const free = map.kinds[code] === "admitted";
    if (words === "admitted") return { base: rgb(open), mark: rgb(open), pattern, free };
    const colour = rgb(map.colours[code]);
    const light = 0.3 * colour[0] + 0.59 * colour[1] + 0.11 * colour[2];
    const full = dark
      ? mix(colour, [14, 16, 18], light > 140 ? 0.42 : 0.18)
      : mix(colour, [255, 255, 255], 0.12);
    const base = shaded ? mix(full, dark ? [23, 26, 29] : [255, 255, 255], 0.72) : full;
    const mark = mix(base, light > 120 ? [0, 0, 0] : [255, 255, 255], light > 120 ? 0.2 : 0.24);
    return { base, mark, pattern, free };
  });
}

const packed = (/** @type {Rgb} */ [r, g, b]) => (255 << 24) | (b << 16) | (g << 8) | r;

const NEAR_MARK = packed([255, 255, 255]);

/** @returns {number[]} the colours of the codes of a shade, as pixels */
const shadeInks = () =>
  Array.from({ length: MOST + 1 }, (_, code) =>
    packed(rgb(`#${alongScale(code / MOST).getHexString()}`)),
  );

/**
 * Whether a pixel is on the lines of a pattern.
 * @param {Pattern} pattern
 * @param {number} x
 * @param {number} y
 * @param {number} period
 */
function marked(pattern, x, y, period) {
  const thick = period / 6;
  switch (pattern) {
    case "rising":
      return (x + y) % period < thick;
    case "falling":
      return (((x - y) % period) + period) % period < thick;
    case "dots":
      return x % period < 1.5 * thick && y % period < 1.5 * thick;
    case "cross":
      return (x + y) % period < thick || (((x - y) % period) + period) % period < thick;
    case "level":
      return y % period < thick;
    default:
      return false;
  }
}

/**
 * Return the pixels of a square of one ink.
 * @param {Ink} ink
 * @param {number} size  px
 * @param {number} period  px, of its pattern
 */
export function swatch({ base, mark, pattern }, size, period) {
  const image = new ImageData(size, size);
  const out = new Uint32Array(image.data.buffer);
  for (let i = 0; i < out.length; i++)
    out[i] = packed(marked(pattern, i % size, Math.floor(i / size), period) ? mark : base);
  return image;
}

/**
 * Return the pixels of a layer: path length to the right, gamma upwards.
 * @param {Grid} grid
 * @param {number} layer
 * @param {Ink[]} ink
 * @param {{width: number, height: number, period: number}} size  device px; the period of patterns
 * @param {import("./window.js").Window} [window]  the part that is seen
 * @param {import("./shade.js").Shade | null} [shade]  of the admitted
 * @returns {ImageData}
 */
export function pixels(grid, layer, ink, { width, height, period }, window = WHOLE, shade = null) {
  const image = new ImageData(width, height);
  const out = new Uint32Array(image.data.buffer);
  const [bases, marks] = [ink.map(({ base }) => packed(base)), ink.map(({ mark }) => packed(mark))];
  const first = grid.message.s[0];
  const { from, to, top, bottom } = window;
  const column = new Int32Array(width);
  for (let x = 0; x < width; x++) {
    const share = from + ((x + 0.5) / width) * (to - from);
    column[x] = grid.nodeAt(first + share * grid.length) * grid.samples;
  }
  const { codes, posture } = grid.layers[layer];
  const shades = shade?.of(posture);
  const ramp = shade ? shadeInks() : [];
  for (let y = 0; y < height; y++) {
    const share = top + ((y + 0.5) / height) * (bottom - top);
    const sample = grid.sampleAt(Math.PI - share * 2 * Math.PI);
    for (let x = 0; x < width; x++) {
      const code = codes[column[x] + sample];
      const value = shades && ink[code].free ? shades[column[x] + sample] : NO_SHADE;
      if (value < TOO_NEAR) out[y * width + x] = ramp[value];
      else if (value === TOO_NEAR)
        out[y * width + x] = marked("cross", x, y, period) ? NEAR_MARK : ramp[0];
      else out[y * width + x] = marked(ink[code].pattern, x, y, period) ? marks[code] : bases[code];
    }
  }
  return image;
}
