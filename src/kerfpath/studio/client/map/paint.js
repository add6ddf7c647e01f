/** The cells of a map as pixels: a colour and a pattern for each reason, in either theme. */

/** @typedef {import("./grid.js").Grid} Grid */
/** @typedef {[number, number, number]} Rgb */
/** @typedef {"none" | "rising" | "falling" | "dots" | "cross" | "level"} Pattern */
/** @typedef {{base: Rgb, mark: Rgb, pattern: Pattern}} Ink */

/**
 * @param {string} hex  #rrggbb
 * @returns {Rgb}
 */
export const rgb = (hex) => {
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

/**
 * Return the pattern of a reason: it says the same as the colour, for whoever cannot tell colours.
 * @param {string} kind
 * @param {string} words
 * @returns {Pattern}
 */
function patternOf(kind, words) {
  if (kind === "admitted") return "none";
  if (kind === "joint") return words.endsWith("low") ? "falling" : "rising";
  if (kind === "reach") return "dots";
  if (kind === "cell") return "cross";
  if (kind === "margin") return "level";
  if (kind === "pinned") return "none"; // hatched where the pin is drawn
  return "none";
}

/**
 * Return how each code of a map is painted.
 * @param {import("../messages.js").MapMessage} map
 * @param {boolean} dark
 * @param {string} free  #rrggbb
 * @returns {Ink[]}
 */
export function inks(map, dark, free) {
  return map.reasons.map((words, code) => {
    const pattern = patternOf(map.kinds[code], words);
    if (words === "admitted") return { base: rgb(free), mark: rgb(free), pattern };
    const colour = rgb(map.colours[code]);
    const light = 0.3 * colour[0] + 0.59 * colour[1] + 0.11 * colour[2];
    const base = dark
      ? mix(colour, [14, 16, 18], light > 140 ? 0.42 : 0.18)
      : mix(colour, [255, 255, 255], 0.12);
    const mark = mix(base, light > 120 ? [0, 0, 0] : [255, 255, 255], light > 120 ? 0.2 : 0.24);
    return { base, mark, pattern };
  });
}

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
 * Return the pixels of a layer: path length to the right, gamma upwards.
 * @param {Grid} grid
 * @param {number} layer
 * @param {Ink[]} ink
 * @param {number} width  device px
 * @param {number} height  device px
 * @param {number} period  of the patterns, device px
 * @returns {ImageData}
 */
export function pixels(grid, layer, ink, width, height, period) {
  const image = new ImageData(width, height);
  const out = new Uint32Array(image.data.buffer);
  const packed = (/** @type {Rgb} */ [r, g, b]) => (255 << 24) | (b << 16) | (g << 8) | r;
  const [bases, marks] = [ink.map(({ base }) => packed(base)), ink.map(({ mark }) => packed(mark))];
  const first = grid.message.s[0];
  const column = new Int32Array(width);
  for (let x = 0; x < width; x++)
    column[x] = grid.nodeAt(first + ((x + 0.5) / width) * grid.length) * grid.samples;
  const { codes } = grid.layers[layer];
  for (let y = 0; y < height; y++) {
    const sample = grid.sampleAt(Math.PI - ((y + 0.5) / height) * 2 * Math.PI);
    for (let x = 0; x < width; x++) {
      const code = codes[column[x] + sample];
      out[y * width + x] = marked(ink[code].pattern, x, y, period) ? marks[code] : bases[code];
    }
  }
  return image;
}
