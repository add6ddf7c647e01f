/** The visible part of a map: shares of its length and of its height, from the top left. */

/** @typedef {Readonly<{from: number, to: number, top: number, bottom: number}>} Window */

/** @type {Window} */
export const WHOLE = { from: 0, to: 1, top: 0, bottom: 1 };

/**
 * Return an interval with a length that begins near a place and stays within 0 and 1.
 * @param {number} begin
 * @param {number} length
 */
function within(begin, length) {
  const from = Math.min(Math.max(begin, 0), 1 - length);
  return [from, from + length];
}

/**
 * Return the view after a zoom about a place.
 * @param {Window} seen
 * @param {number} x  share of what is seen, from the left
 * @param {number} y  share of what is seen, from the top
 * @param {number} factor  below 1 nearer
 * @param {{across: number, down: number}} least  shares of the map
 * @returns {Window}
 */
export function zoomed(seen, x, y, factor, least) {
  const [wide, tall] = [seen.to - seen.from, seen.bottom - seen.top];
  const across = Math.min(1, Math.max(wide * factor, Math.min(least.across, wide)));
  const down = Math.min(1, Math.max(tall * factor, Math.min(least.down, tall)));
  const [from, to] = within(seen.from + x * (wide - across), across);
  const [top, bottom] = within(seen.top + y * (tall - down), down);
  return { from, to, top, bottom };
}

/**
 * Return the view after a move.
 * @param {Window} seen
 * @param {number} x  share of what is seen, to the right
 * @param {number} y  share of what is seen, downwards
 * @returns {Window}
 */
export function moved(seen, x, y) {
  const [wide, tall] = [seen.to - seen.from, seen.bottom - seen.top];
  const [from, to] = within(seen.from + x * wide, wide);
  const [top, bottom] = within(seen.top + y * tall, tall);
  return { from, to, top, bottom };
}

/**
 * Return the view, moved as little as possible so that it contains a place.
 * @param {Window} seen
 * @param {number} along  share of the map, from the left
 * @param {number} down  share of the map, from the top
 */
export function showing(seen, along, down) {
  const [wide, tall] = [seen.to - seen.from, seen.bottom - seen.top];
  const over = (/** @type {number} */ at, /** @type {number} */ low, /** @type {number} */ high) =>
    at < low ? at - low : at > high ? at - high : 0;
  return moved(
    seen,
    over(along, seen.from, seen.to) / wide,
    over(down, seen.top, seen.bottom) / tall,
  );
}

/** @param {Window} seen */
export const isWhole = ({ from, to, top, bottom }) => to - from >= 1 && bottom - top >= 1;
