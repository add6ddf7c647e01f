/** The elements of the page, the colours and text size of its theme, and its frames. */

/**
 * Return the element of the page with an id; throws if it is missing.
 * @template {HTMLElement} T
 * @param {string} id
 * @param {new () => T} [kind]
 * @returns {T}
 */
export function byId(id, kind) {
  const found = document.getElementById(id);
  if (!found || (kind && !(found instanceof kind))) throw new Error(`the page has no #${id}`);
  return /** @type {T} */ (found);
}

/**
 * Return a function that calls `act` once before the next frame of the screen.
 * @param {() => void} act
 */
export function onNextFrame(act) {
  let waiting = false;
  return () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      act();
    });
  };
}

/** @type {Record<string, [number, number] | undefined>} directions of keys: to the right, downwards */
export const ARROWS = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

/** @type {Map<string, string>} cached, as every frame needs them; by theme and name */
const colours = new Map();

/**
 * Return a colour of the current theme, in CSS notation.
 * @param {string} name  of the custom property, as "--ink"
 * @returns {string}
 */
export function themeColour(name) {
  const key = `${document.documentElement.dataset.theme} ${name}`;
  let known = colours.get(key);
  if (known === undefined) {
    known = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    if (known) colours.set(key, known);
  }
  return known;
}

let size = 0;
addEventListener("resize", () => (size = 0));

/** Return the size of the page's text in px, which canvases also use. */
export function textSize() {
  size ||= parseFloat(getComputedStyle(document.documentElement).fontSize);
  return size;
}

/**
 * Match the resolution of a canvas to its size on the screen, and clear it.
 * @param {HTMLCanvasElement} canvas
 * @returns {CanvasRenderingContext2D | null} for CSS px; null: it has no size
 */
export function freshContext(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas;
  const [w, h] = [width, height].map((each) => Math.round(each * pixelRatio()));
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  const context = canvas.getContext("2d");
  if (!context || !w || !h) return null;
  context.setTransform(pixelRatio(), 0, 0, pixelRatio(), 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}

/** Return the number of pixels of a canvas per CSS px: two at most, to keep drawing fast. */
export const pixelRatio = () => Math.min(window.devicePixelRatio || 1, 2);

/**
 * Place a floating element at a place of a canvas, inside it.
 * @param {HTMLElement} element
 * @param {number} x  px
 * @param {number} y  px
 * @param {HTMLCanvasElement} canvas
 */
export function floatAt(element, x, y, { clientWidth, clientHeight }) {
  const left = Math.max(8, Math.min(x, clientWidth - element.offsetWidth - 8));
  const top = Math.max(8, Math.min(y, clientHeight - element.offsetHeight - 8));
  element.style.transform = `translate(${left}px, ${top}px)`;
}
